"""Rays: plain numpy reads them, equal rays are equal bytes, broken files are named."""

from __future__ import annotations

import io
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.drives.kitti.rays import PointRays, decode_rays, encode_rays, read_rays
from cosim.errors import FormatError


def _rays(count: int, seed: int = 0) -> PointRays:
    rng = np.random.default_rng(seed)
    azimuth = rng.uniform(-np.pi, np.pi, count)
    return PointRays(rng.integers(0, 64, count), azimuth, -azimuth / (2 * np.pi) * 0.1, rng.integers(0, 2, count))


@given(st.integers(0, 300), st.integers(0, 2**32 - 1))
def test_numpy_reads_what_was_written(count: int, seed: int) -> None:
    rays = _rays(count, seed)
    with np.load(io.BytesIO(encode_rays(rays))) as file:
        assert sorted(file.files) == ["azimuth", "return_no", "ring", "time_s"]
        assert [file[name].dtype for name in ("ring", "azimuth", "time_s", "return_no")] == [
            np.uint8,
            np.float32,
            np.float32,
            np.uint8,
        ]
        for name in file.files:
            assert np.array_equal(file[name], getattr(rays, name))
    read = decode_rays(encode_rays(rays), points=count)
    assert np.array_equal(read.time_s, rays.time_s)
    assert not read.recovered


def test_the_clock_does_not_reach_the_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    before = encode_rays(_rays(1000))
    monkeypatch.setattr(time, "time", lambda: 2_000_000_000.0)
    monkeypatch.setattr(time, "localtime", lambda *_: time.gmtime(2_000_000_000))
    assert encode_rays(_rays(1000)) == before


def test_numpys_own_files_are_read(tmp_path: Path) -> None:
    rays = _rays(10)
    columns = {name: getattr(rays, name) for name in ("ring", "azimuth", "time_s", "return_no")}
    np.savez_compressed(tmp_path / "a.npz", **columns, extra=np.arange(3))
    assert np.array_equal(read_rays(tmp_path / "a.npz").azimuth, rays.azimuth)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ring": None}, "missing ring"),
        ({"azimuth": np.zeros(3)}, "azimuth has 3 entries but the scan 10 points"),
        ({"ring": np.full(10, 300)}, "ring is int64"),
        ({"ring": np.full(10, 300, np.uint16)}, "ring spans 300…300"),
        ({"time_s": np.full(10, np.nan)}, "time_s holds NaN"),
        ({"azimuth": np.zeros((10, 2))}, r"azimuth is float64 of shape \(10, 2\)"),
        ({"azimuth": np.array(["a"] * 10)}, "azimuth is <U1"),
        ({"azimuth": np.array([None] * 10)}, "not a readable .npz file"),
    ],
)
def test_faults_are_named(tmp_path: Path, change: dict[str, np.ndarray | None], message: str) -> None:
    rays = _rays(10)
    columns = {name: getattr(rays, name) for name in ("ring", "azimuth", "time_s", "return_no")} | change
    np.savez(tmp_path / "a.npz", **{name: column for name, column in columns.items() if column is not None})
    with pytest.raises(FormatError, match=rf"a\.npz: .*{message}"):
        read_rays(tmp_path / "a.npz", points=10)


@given(st.data())
def test_no_damage_escapes_as_another_error(data: st.DataObject) -> None:
    content = bytearray(encode_rays(_rays(50)))
    cut = data.draw(st.integers(0, len(content)))
    content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    for damaged in (bytes(content), bytes(content[:cut])):
        try:
            decode_rays(damaged, "damaged", points=50)
        except FormatError as error:
            assert "damaged" in str(error)


def test_columns_of_unequal_length_are_refused() -> None:
    with pytest.raises(FormatError, match="time_s has shape"):
        PointRays(np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(3))
