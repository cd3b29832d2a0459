"""Scans in order, with their stamps and poses; what is not one sensor's recording is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.recordings import RecordingError, open_recording


def scans(folder: Path, count: int, names: str = "{:06d}.bin") -> Path:
    """A folder of scans whose first point encodes their number."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(count):
        rows = np.full((10, 4), 0.5, np.float32)
        rows[0, 0] = number + 1
        rows.tofile(folder / names.format(number))
    return folder


def order(path: Path, **options: object) -> list[int]:
    return [int(scan.xyz[0, 0]) - 1 for scan in open_recording(path, **options)]


def test_scans_come_in_the_order_of_the_numbers_in_their_names(tmp_path: Path) -> None:
    assert order(scans(tmp_path, 12, "scan_{}.bin")) == list(range(12))


@pytest.mark.parametrize("below", ["velodyne", "velodyne_points/data", "lidar", "anything"])
def test_scans_are_detected_below_the_folder(tmp_path: Path, below: str) -> None:
    scans(tmp_path / below, 3)
    assert order(tmp_path) == [0, 1, 2]


def test_two_folders_of_scans_ask_for_one(tmp_path: Path) -> None:
    scans(tmp_path / "front", 2)
    scans(tmp_path / "rear", 2)
    with pytest.raises(RecordingError, match="scans in front, rear; give one"):
        open_recording(tmp_path)


def test_a_pattern_chooses_the_scans(tmp_path: Path) -> None:
    scans(tmp_path, 3, "raw_{}.bin")
    (tmp_path / "times_0.bin").write_bytes(b"1234567")
    with pytest.raises(RecordingError, match="--scans"):
        open_recording(tmp_path)
    assert order(tmp_path, scans="raw_*.bin") == [0, 1, 2]
    (tmp_path / "recording.yaml").write_text("scans: raw_*.bin\n")
    assert order(tmp_path) == [0, 1, 2]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("scan: raw_*.bin\n", "unknown key 'scan'"),
        ("mount: {height_m: -1}\n", "mount.height_m"),
        ("sweep_s: fast\n", "sweep_s"),
    ],
)
def test_settings_are_checked(tmp_path: Path, text: str, words: str) -> None:
    scans(tmp_path, 1)
    (tmp_path / "recording.yaml").write_text(text)
    with pytest.raises(RecordingError, match=words):
        open_recording(tmp_path)


def test_files_of_several_formats_or_fields_are_refused(tmp_path: Path) -> None:
    scans(tmp_path, 2)
    np.save(tmp_path / "000009.npy", np.ones((5, 4)))
    with pytest.raises(RecordingError, match=r"several formats \(2 .bin, 1 .npy\)"):
        open_recording(tmp_path)
    for file in tmp_path.glob("*.bin"):
        file.unlink()
    np.save(tmp_path / "000010.npy", np.ones((5, 5)))
    with pytest.raises(RecordingError, match="different fields"):
        open_recording(tmp_path)


def test_a_gap_in_time_is_reported(tmp_path: Path) -> None:
    scans(tmp_path, 6)
    (tmp_path / "times.txt").write_text("0\n0.1\n0.2\n0.3\n1.4\n1.5\n")
    recording = open_recording(tmp_path)
    assert recording.gaps() == (4,) and recording.interval_s == pytest.approx(0.1)
    assert any("1.10 s between scans 000003 and 000004" in note for note in recording.notes)


def test_stamps_are_read_from_names_and_from_kittis_dates(tmp_path: Path) -> None:
    named = scans(tmp_path / "a", 3, "1700000000{}00000000.bin")
    np.testing.assert_allclose(np.diff(open_recording(named).stamp_s), 0.1, rtol=1e-5)  # type: ignore[arg-type]
    dated = scans(tmp_path / "b", 2)
    (dated / "timestamps.txt").write_text("2011-09-26 13:02:44.300000000\n2011-09-26 13:02:44.403500000\n")
    assert open_recording(dated).interval_s == pytest.approx(0.1035, rel=1e-5)


def turning(count: int) -> np.ndarray:
    """Poses that drive ahead along x and turn to the left."""
    poses = [np.eye(4)]
    cos, sin = np.cos(0.02), np.sin(0.02)
    step = np.array([[cos, -sin, 0, 0.7], [sin, cos, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    for _ in range(count - 1):
        poses.append(poses[-1] @ step)
    return np.array(poses)


CAMERA = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])  # from LiDAR axes


def write_kitti(file: Path, poses: np.ndarray) -> None:
    file.write_text("".join(" ".join(map(repr, pose[:3].ravel().tolist())) + "\n" for pose in poses))


def test_kittis_poses_of_a_camera_become_the_sensors(tmp_path: Path) -> None:
    scans(tmp_path, 9)
    wanted = turning(9)
    write_kitti(tmp_path / "poses.txt", CAMERA @ wanted @ np.linalg.inv(CAMERA))
    with pytest.raises(RecordingError, match="camera axes"):
        open_recording(tmp_path)
    (tmp_path / "calib.txt").write_text("Tr: " + " ".join(map(str, CAMERA[:3].ravel())) + "\n")
    np.testing.assert_allclose(open_recording(tmp_path).poses, wanted, atol=1e-9)  # type: ignore[arg-type]


def test_poses_of_tum_are_taken_at_the_times_of_scans(tmp_path: Path) -> None:
    scans(tmp_path, 5)
    (tmp_path / "times.txt").write_text("".join(f"{0.1 * row}\n" for row in range(5)))
    fine = np.arange(0, 0.45, 0.01)
    (tmp_path / "poses.tum").write_text("".join(f"{t} {7 * t} 0 0 0 0 0 1\n" for t in fine))
    poses = open_recording(tmp_path).poses
    assert poses is not None
    np.testing.assert_allclose(poses[:, 0, 3], 0.7 * np.arange(5), atol=1e-9)


def test_gps_records_give_poses(tmp_path: Path) -> None:
    from cosim.drives.kitti.oxts import Oxts, write_oxts

    scans(tmp_path / "velodyne", 4)
    wanted = turning(4)
    (tmp_path / "oxts").mkdir()
    for number, pose in enumerate(wanted):
        write_oxts(tmp_path / f"oxts/{number:06d}.txt", Oxts.from_motion(pose, np.zeros(3), 0.0, np.zeros(3)))
    np.testing.assert_allclose(open_recording(tmp_path).poses, wanted, atol=1e-3)  # type: ignore[arg-type]


def test_poses_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    scans(tmp_path, 3)
    write_kitti(tmp_path / "poses.txt", turning(4))
    with pytest.raises(RecordingError, match="4 poses for 3 scans"):
        open_recording(tmp_path)
    write_kitti(tmp_path / "poses.txt", 2 * turning(3))
    with pytest.raises(RecordingError, match="not a rotation"):
        open_recording(tmp_path)


def test_reading_a_recording_imports_no_library_of_another_format() -> None:
    import subprocess
    import sys

    code = (
        "import sys, cosim.recordings; "
        "print(sorted({'torch', 'rosbags', 'kiss_icp', 'polars', 'ouster', 'trimesh'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"
