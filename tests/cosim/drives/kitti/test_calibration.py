"""Calibration: KITTI's files byte for byte, and its projection."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.drives.kitti.calibration import Calibration, format_calibration, parse_calibration, read_calibration
from cosim.errors import FormatError

SQUARE = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0]], float)  # camera squarely at the LiDAR's origin
P = np.array([[700, 0, 600, 0], [0, 700, 170, 0], [0, 0, 1, 0]], float)


def _random(seed: int) -> Calibration:
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrices = {f"P{camera}": P + rng.normal(size=(3, 4)) for camera in range(4)}
    tr = np.c_[rotation @ SQUARE[:, :3], rng.normal(size=3)]
    return Calibration(R0_rect=rotation, Tr_velo_to_cam=tr, Tr_imu_to_velo=rng.normal(size=(3, 4)), **matrices)


@given(st.integers(0, 2**32 - 1))
def test_matrices_survive_the_file_to_1e_12(seed: int) -> None:
    calibration = _random(seed)
    read = parse_calibration(format_calibration(calibration))
    for name in ("P0", "P1", "P2", "P3", "R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo"):
        assert np.allclose(getattr(read, name), getattr(calibration, name), rtol=1e-12, atol=0)


@given(st.integers(0, 2**32 - 1))
def test_going_to_the_camera_and_back_returns_each_point(seed: int) -> None:
    calibration = _random(seed)
    points = np.random.default_rng(seed).uniform(-80, 80, (20, 4)).astype(np.float32)
    assert np.allclose(calibration.rect_to_velo(calibration.velo_to_rect(points)), points[:, :3], atol=1e-9)


def test_a_point_ahead_is_at_the_principal_point_and_left_is_left() -> None:
    calibration = Calibration(P2=P, R0_rect=np.eye(3), Tr_velo_to_cam=SQUARE)
    uv, depth = calibration.project(np.array([[10.0, 0, 0], [10, 1, 0], [10, 0, 1], [-5, 0, 0]]))
    assert np.allclose(uv[:3], [[600, 170], [530, 170], [600, 100]])
    assert np.allclose(depth, [10, 10, 10, -5])
    assert np.isnan(uv[3]).all()


def test_the_tracking_spelling_reads_equally() -> None:
    text = format_calibration(_random(1))
    tracking = text.replace("R0_rect:", "R_rect").replace("Tr_velo_to_cam:", "Tr_velo_cam")
    tracking = tracking.replace("Tr_imu_to_velo:", "Tr_imu_velo")
    assert format_calibration(parse_calibration(tracking)) == text


def test_cameras_may_be_absent_but_not_requested() -> None:
    calibration = Calibration(P2=P, R0_rect=np.eye(3), Tr_velo_to_cam=SQUARE)
    assert parse_calibration(format_calibration(calibration)).cameras == (2,)
    with pytest.raises(FormatError, match=r"no P0; cameras with a matrix: \(2,\)"):
        calibration.project(np.ones((1, 3)), camera=0)


def test_names_without_numbers_are_matrices_that_are_not_given() -> None:
    text = format_calibration(Calibration(P2=P, R0_rect=np.eye(3), Tr_velo_to_cam=SQUARE))
    lines = [line if line.startswith(("P2", "Tr_velo")) else line.partition(":")[0] + ":" for line in text.split("\n")]
    read = parse_calibration("\n".join(["P0:", "P1: ", "P3:", *lines, "Tr_imu_to_velo:"]))
    assert read.cameras == (2,) and read.Tr_imu_to_velo is None
    assert np.array_equal(read.R0_rect, np.eye(3))
    with pytest.raises(FormatError, match="missing P2; a calibration needs"):
        parse_calibration(text.replace("P2: ", "P2:\nnothing: "), "calib")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("P2:", "Px:", "missing P2"),
        ("R0_rect: ", "R0_rect: 1.0 ", r"calib:5: R0_rect has 10 numbers; expected 3 × 3"),
        ("Tr_velo_to_cam: ", "Tr_velo_to_cam: x", "is not a number"),
        ("P3:", "P2:", "P2 is there twice"),
        ("P0: ", "P0: nan ", "13 numbers"),
    ],
)
def test_faults_are_named(old: str, new: str, message: str) -> None:
    text = format_calibration(_random(2)).replace(old, new)
    with pytest.raises(FormatError, match=message):
        parse_calibration(text, "calib")


def test_a_calibration_that_flattens_space_is_refused() -> None:
    with pytest.raises(FormatError, match="singular"):
        Calibration(P2=P, R0_rect=np.zeros((3, 3)), Tr_velo_to_cam=SQUARE)


def test_real_files_are_rewritten_byte_for_byte(kitti_source: Path) -> None:
    for file in sorted((kitti_source / "calib").glob("*.txt"))[:20]:
        assert format_calibration(read_calibration(file)) == file.read_text()
