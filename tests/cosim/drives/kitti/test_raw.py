"""Raw drives of KITTI, as they are downloaded: numbered scans of which some are missing, one calibration a day."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.cli import main
from cosim.drives.kitti import Drive, encode_rgb, write_points
from cosim.errors import DriveError, FormatError
from tests.cosim.drives.kitti.conftest import CALIBRATION

_SCANS = (0, 1, 5, 6)
_IMAGES = (0, 2, 5)
_TURN = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]], float)


def words(matrix: np.ndarray) -> str:
    return " ".join(f"{value:.6e}" for value in np.ravel(matrix))


@pytest.fixture
def raw_drive(tmp_path: Path) -> Path:
    day = tmp_path / "2011_09_26"
    drive = day / "2011_09_26_drive_0009_sync"
    for part in ("velodyne_points/data", "image_02/data", "oxts/data"):
        (drive / part).mkdir(parents=True)
    for number in _SCANS:
        azimuth = np.linspace(3, -3, 200)
        points = np.stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), 0 * azimuth, 0.5 + 0 * azimuth], -1)
        write_points(drive / f"velodyne_points/data/{number:010d}.bin", points)
    for number in _IMAGES:
        png = encode_rgb(np.full((100, 160, 3), number, np.uint8))
        (drive / f"image_02/data/{number:010d}.png").write_bytes(png)
    (drive / "velodyne_points/timestamps.txt").write_text("2011-09-26 13:02:44.3\n" * 7)
    date = "calib_time: 15-Mar-2012 11:37:16\n"
    (day / "calib_velo_to_cam.txt").write_text(f"{date}R: {words(_TURN)}\nT: 0 -0.08 -0.27\ndelta_f: 0 0\n")
    (day / "calib_imu_to_velo.txt").write_text(f"{date}R: {words(np.eye(3))}\nT: -0.81 0.32 -0.80\n")
    cameras = "".join(
        f"S_{camera}: 1242 375\nR_rect_{camera}: {words(np.eye(3))}\nP_rect_{camera}: {words(CALIBRATION.P2)}\n"
        for camera in ("00", "02")
    )
    (day / "calib_cam_to_cam.txt").write_text(date + cameras)
    return drive


def test_a_raw_drive_is_read_where_scans_and_images_are_missing(raw_drive: Path) -> None:
    drive = Drive(raw_drive)
    assert drive.frames == tuple(f"{number:010d}" for number in _SCANS)
    assert [drive[name].has("image_2") for name in drive.frames] == [number in _IMAGES for number in _SCANS]
    frame = drive["0000000005"]
    assert len(frame.points) == 200 and (frame.image() == 5).all()
    for name in ("P2", "R0_rect", "Tr_velo_to_cam"):
        np.testing.assert_allclose(getattr(frame.calibration, name), getattr(CALIBRATION, name), atol=1e-6)
    np.testing.assert_allclose(frame.calibration.Tr_imu_to_velo, np.c_[np.eye(3), [-0.81, 0.32, -0.80]])
    assert frame.calibration.cameras == (0, 2)
    assert "image_2/ is absent for 2 of 4 frames: no colour images" in drive.missing


def test_statistics_and_views_of_a_raw_drive(raw_drive: Path, tmp_path: Path) -> None:
    assert main(["stats", str(raw_drive), "--out", str(tmp_path / "stats"), "--quiet"]) == 0
    assert main(["view", str(raw_drive), "--out", str(tmp_path / "view.html"), "--quiet"]) == 0


def test_detections_on_a_raw_drive_use_its_calibration(raw_drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "detections"
    assert main(["detect", str(raw_drive), "--device", "cpu", "--out", str(out), "--quiet"]) == 0
    assert sorted(file.stem for file in out.glob("*.txt")) == [f"{number:010d}" for number in _SCANS]
    assert not (out / "calib").exists(), "no other calibration is made up"


def test_what_a_raw_drive_lacks_is_named(raw_drive: Path) -> None:
    (raw_drive.parent / "calib_cam_to_cam.txt").unlink()
    with pytest.raises(FormatError, match=r"calib_cam_to_cam\.txt: cannot be read"):
        _ = Drive(raw_drive)["0000000000"].calibration
    (raw_drive.parent / "calib_velo_to_cam.txt").write_text("R: 1 0 0\n")
    (raw_drive.parent / "calib_cam_to_cam.txt").write_text(f"P_rect_02: {words(CALIBRATION.P2)}\n")
    with pytest.raises(FormatError, match="Tr_velo_to_cam has 3 numbers"):
        _ = Drive(raw_drive)["0000000000"].calibration
    (raw_drive.parent / "calib_velo_to_cam.txt").unlink()
    with pytest.raises(DriveError, match=r"a raw drive needs calib_velo_to_cam\.txt and calib_cam_to_cam\.txt"):
        Drive(raw_drive)


def test_one_calibration_file_holds_for_all_frames(drive_root: Path) -> None:
    first = sorted((drive_root / "calib").iterdir())[0].read_text()
    for file in (drive_root / "calib").iterdir():
        file.unlink()
    (drive_root / "calib").rmdir()
    (drive_root / "calib.txt").write_text(first.replace("Tr_velo_to_cam:", "Tr:").replace("R0_rect:", "unused:"))
    frame = Drive(drive_root)["000002"]
    np.testing.assert_allclose(frame.calibration.velo_to_rect_matrix, CALIBRATION.velo_to_rect_matrix)
