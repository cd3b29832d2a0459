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


def missing_scans(folder: Path, kept: list[int], stamp_s: list[float | None]) -> Path:
    """A raw drive of KITTI with some of its scans and times; a time that is None is an empty line."""
    data = scans(folder / "velodyne_points/data", 24, "{:010d}.bin")
    for number in {*range(24)} - {*kept}:
        (data / f"{number:010d}.bin").unlink()
    lines = ["" if value is None else f"2011-09-26 13:02:{value:012.9f}" for value in stamp_s]
    (data.parent / "timestamps.txt").write_text("\n".join(lines) + "\n")
    return folder


_TIMES = [25.0 + 0.1036 * number for number in range(24)]
_KEPT = [number for number in range(24) if number not in (7, 8, 9, 10)]


@pytest.mark.parametrize(
    ("kept", "lines"),
    [
        (_KEPT, [*range(24)]),
        (_KEPT, _KEPT),
        (_KEPT, [row for row in range(24) if row != 7]),
        (_KEPT[:-3], [*range(24)]),
        (_KEPT[:-3], [row for row in range(24) if row != 7]),
        (_KEPT[3:], [*range(24)]),
        (_KEPT[3:], _KEPT[3:]),
        ([*range(21)], [*range(24)]),
    ],
    ids=["all", "one each", "some", "end missing", "end and one time missing", "start", "start, one each", "copied"],
)
def test_times_of_missing_scans_are_passed_over(kept: list[int], lines: list[int], tmp_path: Path) -> None:
    recording = open_recording(missing_scans(tmp_path, kept, [_TIMES[row] for row in lines]))
    assert recording.stamp_s is not None
    np.testing.assert_allclose(recording.stamp_s % 60, np.array(_TIMES)[kept], atol=1e-6)


def test_an_empty_line_is_the_time_of_a_missing_scan(tmp_path: Path) -> None:
    recording = open_recording(
        missing_scans(tmp_path, _KEPT, [time if row in _KEPT else None for row, time in enumerate(_TIMES)])
    )
    np.testing.assert_allclose(recording.stamp_s % 60, np.array(_TIMES)[_KEPT], atol=1e-6)  # type: ignore[operator]


def test_times_that_contradict_the_numbers_in_names_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"0000000006.bin and 0000000011.bin are 5 intervals apart.* 0\.104 s"):
        open_recording(missing_scans(tmp_path, _KEPT, [*_TIMES[:20]]))
    with pytest.raises(RecordingError, match=r"17 times for 20 scans, and not every scan .* has a time"):
        open_recording(missing_scans(tmp_path, _KEPT, [_TIMES[row] for row in _KEPT[:17]]))


def test_gps_records_are_those_of_the_scans_names(tmp_path: Path) -> None:
    from cosim.drives.kitti.oxts import Oxts, write_oxts

    missing_scans(tmp_path, _KEPT, [*_TIMES])
    (tmp_path / "oxts/data").mkdir(parents=True)
    poses = turning(24)
    for number in range(20):  # as many records as scans, but of others
        write_oxts(
            tmp_path / f"oxts/data/{number:010d}.txt", Oxts.from_motion(poses[number], np.zeros(3), 0.0, np.zeros(3))
        )
    with pytest.raises(RecordingError, match=r"no record for scan 0000000020 \(4 of 20 scans have none\)"):
        open_recording(tmp_path)
    for number in range(20, 24):
        write_oxts(
            tmp_path / f"oxts/data/{number:010d}.txt", Oxts.from_motion(poses[number], np.zeros(3), 0.0, np.zeros(3))
        )
    np.testing.assert_allclose(open_recording(tmp_path).poses, poses[_KEPT], atol=1e-3)  # type: ignore[arg-type]
