"""GPS/IMU records: motion in, motion out, in KITTI's signs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.drives.kitti.oxts import GRAVITY_MPS2, Oxts, format_oxts, parse_oxts
from cosim.errors import FormatError

_ANGLE = st.floats(-3, 3)
_TILT = st.floats(-0.5, 0.5)
_PLACE = st.floats(-3000, 3000)


def _pose(roll: float, pitch: float, yaw: float, position: tuple[float, float, float]) -> np.ndarray:
    def turn(axis: int, angle: float) -> np.ndarray:
        a, b = [(1, 2), (2, 0), (0, 1)][axis]
        matrix = np.eye(4)
        matrix[a, a] = matrix[b, b] = np.cos(angle)
        matrix[a, b], matrix[b, a] = -np.sin(angle), np.sin(angle)
        return matrix

    pose = turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)
    pose[:3, 3] = position
    return pose


@given(_TILT, _TILT, _ANGLE, st.tuples(_PLACE, _PLACE, _PLACE))
def test_poses_survive_the_file(roll: float, pitch: float, yaw: float, place: tuple[float, float, float]) -> None:
    pose = _pose(roll, pitch, yaw, place)
    read = parse_oxts(format_oxts(Oxts.from_motion(pose, np.array([1, 2, 3]), 0.1, np.zeros(3))))
    assert np.allclose(read.pose[:3, :3], pose[:3, :3], atol=1e-9)
    assert np.allclose(read.pose[:3, 3], place, atol=1e-4)
    assert np.allclose(read.velocity_mps, [1, 2, 3])


def test_velocities_are_split_as_kitti_splits_them() -> None:
    heading_north = _pose(0, 0, np.pi / 2, (0, 0, 0))
    record = Oxts.from_motion(heading_north, np.array([-1.0, 8.0, 0.5]), 0.3, np.array([0, 2.0, 0]))
    assert (record.vn, record.ve) == (8, -1)
    assert np.allclose([record.vf, record.vl, record.vu], [8, 1, 0.5])
    assert np.allclose([record.ax, record.ay, record.az], [2, 0, GRAVITY_MPS2])
    assert np.allclose([record.wx, record.wy, record.wz, record.wu], [0, 0, 0.3, 0.3])


def test_an_accelerometer_nose_up_feels_gravity_forward() -> None:
    nose_up = _pose(0, -0.1, 0, (0, 0, 0))
    record = Oxts.from_motion(nose_up, np.zeros(3), 0, np.zeros(3))
    assert record.pitch == pytest.approx(-0.1)
    assert record.ax == pytest.approx(GRAVITY_MPS2 * np.sin(0.1))
    assert record.af == pytest.approx(0)


def test_north_raises_latitude_by_a_degree_in_111_km() -> None:
    here, north = (Oxts.from_motion(_pose(0, 0, 0, (0, y, 0)), np.zeros(3), 0, np.zeros(3)) for y in (0.0, 1000.0))
    assert here.lat == pytest.approx(49)
    assert north.lat - here.lat == pytest.approx(1 / 111.3, rel=1e-3)


def test_a_record_is_one_line_of_thirty_numbers() -> None:
    text = format_oxts(Oxts.from_motion(np.eye(4), np.zeros(3), 0, np.zeros(3)))
    assert text.count("\n") == 1
    assert len(text.split(" ")) == 30
    with pytest.raises(FormatError, match=r"a\.txt: 29 numbers; an oxts record has 30"):
        parse_oxts(text.rsplit(" ", 1)[0], "a.txt")
    with pytest.raises(FormatError, match="'x' is not a number"):
        parse_oxts("x" + text[1:].lstrip("0123456789."), "a.txt")
