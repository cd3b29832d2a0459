"""What may be compared is stored whole, and broken files are named."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cosim.drives.twin import Instance, Trust, encode_trust, read_trust
from cosim.errors import FormatError


def _trust() -> Trust:
    ground = np.zeros((4, 6), bool)
    ground[1, 2] = True
    height_m, scatter_m = np.full((4, 6), 0.1, np.float32), np.full((4, 6), 0.014, np.float32)
    bodies = np.array([0.1], np.float32), np.array([0.2], np.float32)
    return Trust(np.array([-1.0, -2.0]), 0.5, ground, height_m, True, 0.19, 6.5, scatter_m, 0.1, *bodies)


def _box() -> Instance:
    pose = np.eye(4)
    pose[:3, 3] = 10, 0, 0
    return Instance("car0", "car", "hatchback_01", pose, np.zeros(3), 0.0, 4.0, 2.0, 1.5, np.ones(3), 0.5)


def test_a_file_gives_back_what_was_written(tmp_path: Path) -> None:
    file, trust = tmp_path / "a.npz", _trust()
    file.write_bytes(encode_trust(trust))
    back = read_trust(file)
    for name, value in vars(trust).items():
        assert np.array_equal(getattr(back, name), value), name


def test_a_return_is_trusted_over_trusted_ground_or_in_a_box() -> None:
    inside, beside, high = [-0.25, -0.75, 0.2], [0.25, -0.75, 0.2], [-0.25, -0.75, 0.6]
    on_car, near_car, off_car = [12.2, 0, 1.0], [10, 1.2, 1.7], [12.4, 0, 1.0]
    nothing = [np.nan] * 3
    places = np.array([inside, beside, high, on_car, near_car, off_car, nothing])
    assert _trust().measured(places, [_box()]).tolist() == [True, False, False, True, True, False, False]


def test_a_beam_is_compared_if_both_ends_are_reliable() -> None:
    ground, car, other = [-0.25, -0.75, 0.1], [10.0, 0, 1.0], [30.0, 0, 1.0]
    nothing = [np.nan] * 3
    traced = np.array([ground, ground, ground, car, car, other, other])
    instance = np.array([-1, -1, -1, 0, 0, -1, -2])
    measured = np.array([ground, nothing, other, car, ground, ground, ground])
    expected = [True, True, False, True, False, False, False]
    assert _trust().beams([_box()], traced, instance, measured).tolist() == expected


def test_no_ground_trusts_boxes_alone() -> None:
    assert Trust.nothing().measured(np.array([[0.1, 0.1, 0], [10, 0, 1.0]]), [_box()]).tolist() == [False, True]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_files_are_named(tmp_path: Path, data: st.DataObject) -> None:
    whole = bytearray(encode_trust(_trust()))
    for position in data.draw(st.lists(st.integers(0, len(whole) - 1), min_size=1, max_size=30)):
        whole[position] = data.draw(st.integers(0, 255))
    file = tmp_path / "broken.npz"
    file.write_bytes(bytes(whole[: data.draw(st.integers(0, len(whole)))]))
    try:
        read_trust(file)
    except FormatError as error:
        assert "broken.npz" in str(error)
        assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ground", np.zeros(3)),
        ("height_m", np.zeros((2, 2))),
        ("cell_m", np.array([0.0])),
        ("cone_deg", np.array([np.nan])),
        ("corner_m", np.array(["a", "b"])),
    ],
)
def test_arrays_of_another_shape_are_refused(tmp_path: Path, name: str, value: np.ndarray) -> None:
    arrays = dict(np.load(io.BytesIO(encode_trust(_trust()))))
    file = tmp_path / "odd.npz"
    np.savez(file, **(arrays | {name: value}))
    with pytest.raises(FormatError, match="arrays of the wrong shape or kind"):
        read_trust(file)
    arrays.pop(name)
    np.savez(file, **arrays)
    with pytest.raises(FormatError, match=f"missing {name}"):
        read_trust(file)
