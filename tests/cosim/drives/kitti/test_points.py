"""Scans: what is written is what is read, and broken files are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cosim.drives.kitti.points import decode_points, encode_points, read_points, read_points_lenient, write_points
from cosim.errors import FormatError

_SCANS = arrays(
    np.float32, st.tuples(st.integers(0, 40), st.just(4)), elements=st.floats(-200, 200, width=32, allow_nan=False)
)


@given(_SCANS)
def test_a_scan_survives_the_file_bit_for_bit(points: np.ndarray) -> None:
    data = encode_points(points)
    read, finite = decode_points(data)
    assert read.dtype == np.float32
    assert finite.all()
    assert read.tobytes() == points.tobytes() == data


@given(_SCANS)
def test_a_plain_kitti_reader_sees_the_same_points(points: np.ndarray) -> None:
    plain = np.frombuffer(encode_points(points.astype(np.float64)), dtype=np.float32).reshape(-1, 4)
    assert np.array_equal(plain, points)


def test_an_empty_file_is_a_scan_without_returns(tmp_path: Path) -> None:
    write_points(tmp_path / "a.bin", np.zeros((0, 4)))
    assert (tmp_path / "a.bin").stat().st_size == 0
    assert read_points(tmp_path / "a.bin").shape == (0, 4)


@pytest.mark.parametrize("extra", [1, 4, 15])
def test_a_truncated_file_is_named_with_its_size(tmp_path: Path, extra: int) -> None:
    (tmp_path / "a.bin").write_bytes(bytes(32 + extra))
    with pytest.raises(FormatError, match=rf"a\.bin: {32 + extra} bytes .*multiple of 16.*truncated"):
        read_points(tmp_path / "a.bin")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_broken_numbers_are_refused_on_writing_and_counted_on_reading(tmp_path: Path, value: float) -> None:
    points = np.ones((5, 4), np.float32)
    points[[1, 3], [0, 3]] = value
    with pytest.raises(FormatError, match=r"2 of 5 points hold NaN or infinity \(first: row 1\)"):
        encode_points(points)
    (tmp_path / "a.bin").write_bytes(points.tobytes())
    with pytest.raises(FormatError, match="2 of 5"):
        read_points(tmp_path / "a.bin")
    kept, finite = read_points_lenient(tmp_path / "a.bin")
    assert finite.tolist() == [True, False, True, False, True]
    assert np.array_equal(kept, np.ones((3, 4)))


def test_numbers_too_large_for_float32_are_refused() -> None:
    with pytest.raises(FormatError, match="infinity"), np.errstate(over="ignore"):
        encode_points(np.full((1, 4), 1e300))


@pytest.mark.parametrize("shape", [(4,), (2, 3), (2, 5), (1, 2, 4)])
def test_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(FormatError, match=r"a scan is \(n, 4\)"):
        encode_points(np.zeros(shape))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"none\.bin: cannot be read"):
        read_points(tmp_path / "none.bin")
