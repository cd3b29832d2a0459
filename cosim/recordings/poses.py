"""Poses that come with a recording: KITTI odometry's, KITTI's GPS/IMU records (`oxts/`), TUM's.

KITTI: a line a scan, the upper three rows of a 4 × 4 matrix, of camera 0 (Geiger et al., CVPR 2012). TUM: `t x y z qx
qy qz qw` (Sturm et al., IROS 2012), of the sensor. All are brought to the sensor's axes, the first pose the origin.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from cosim.drives.files import numbers, read_text
from cosim.drives.kitti.oxts import read_oxts
from cosim.recordings.folder import natural_order, numbered_rows
from cosim.recordings.scan import RecordingError

_PLACES = ("poses.txt", "poses.tum", "trajectory.tum", "trajectory.txt", "oxts/data", "oxts")
_AHEAD_SHARE = 0.8  # of the path that runs along one axis of a sensor that looks ahead
_ORTHONORMAL = 1e-3


def find_poses(root: Path, named: str | None) -> Path | None:
    """The file of a recording's poses.

    Raises:
        RecordingError: the one that was named is absent.
    """
    folder = root if root.is_dir() else root.parent
    if named is not None:
        file = folder / named if not Path(named).is_file() else Path(named)
        if not file.is_file():
            raise RecordingError(f"{named}: no such file of poses; give one in KITTI's or TUM's format, or none")
        return file
    if not root.is_dir():
        return None
    return next((root / name for name in _PLACES if (root / name).exists()), None)


def read_poses(
    file: Path, count: int, stamp_s: np.ndarray | None, names: tuple[str, ...] = ()
) -> tuple[np.ndarray, str]:
    """Poses (n, 4, 4) float64 of the sensor in the axes of its first pose, and a sentence on where they come from.

    Args:
        file: of poses, or the folder of GPS/IMU records.
        count: number of scans.
        stamp_s: (n,) times of the scans; TUM's poses are interpolated to them.
        names: of the scans; their numbers choose the poses where there are more poses than scans.

    Raises:
        RecordingError: no such format, another number of poses than of scans, no rotations, or axes of a camera
            without the calibration that relates them to the sensor's.
    """
    if file.is_dir():
        poses = _from_oxts(file, count, names)
        return np.linalg.inv(poses[0]) @ poses, f"poses from the GPS/IMU records in {file.name}"
    lines = [line.split() for line in read_text(file).splitlines() if line.strip() and not line.startswith("#")]
    width = len(lines[0]) if lines else 0
    if width not in (8, 12, 16) or any(len(line) != width for line in lines):
        raise RecordingError(f"{file}: lines of {width} numbers; KITTI's have 12 (or 16), TUM's 8: t x y z qx qy qz qw")
    rows = np.array([numbers(line, f"{file}:{row}") for row, line in enumerate(lines, 1)])
    poses = _from_tum(rows, file, count, stamp_s) if width == 8 else _from_kitti(rows, file, count, names)
    poses = np.linalg.inv(poses[0]) @ poses
    _demand_ahead(poses, file)
    return poses, f"poses from {file.name}"


def _from_kitti(rows: np.ndarray, file: Path, count: int, names: tuple[str, ...]) -> np.ndarray:
    rows = rows[_rows_of_scans(file, len(rows), count, names)]
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3] = rows[:, :12].reshape(-1, 3, 4)
    off = np.abs(poses[:, :3, :3] @ poses[:, :3, :3].swapaxes(1, 2) - np.eye(3)).max((1, 2))
    if off.max() > _ORTHONORMAL:
        row = int(off.argmax())
        raise RecordingError(f"{file}:{row + 1}: not a rotation (error {off[row]:.2g}); write the pose's 3 × 4 matrix")
    camera = _camera_from_lidar(file.parent)
    return poses if camera is None else np.linalg.inv(camera) @ poses @ camera


def _from_oxts(folder: Path, count: int, names: tuple[str, ...]) -> np.ndarray:
    files = sorted(folder.glob("*.txt"), key=lambda file: natural_order(file.name))
    by_name = {file.stem: file for file in files}
    absent = [name for name in names if name not in by_name]
    if names and not absent:
        files = [by_name[name] for name in names]
    elif 0 < len(absent) < len(names):
        raise RecordingError(
            f"{folder}: no record for scan {absent[0]} ({len(absent)} of {count} scans have none); give one record a "
            "scan, or leave these scans out with --scans"
        )
    elif len(files) != count:
        files = [files[row] for row in _rows_of_scans(folder, len(files), count, names)]
    poses = np.array([read_oxts(file).pose for file in files])
    calib = next(
        (position / "calib.txt" for position in folder.parents[:2] if (position / "calib.txt").is_file()), None
    )
    given = _matrices(calib, ("Tr_imu_to_velo", "Tr_imu_velo")) if calib else {}
    lidar = np.eye(4)
    lidar[:3] = next(iter(given.values()), np.eye(4)[:3].ravel()).reshape(3, 4)
    return poses @ np.linalg.inv(lidar)


def _rows_of_scans(source: Path, held: int, count: int, names: tuple[str, ...]) -> np.ndarray:
    """Row of each scan in a list of poses: its place, or its number where scans are missing."""
    if held == count:
        return np.arange(count)
    rows = numbered_rows(names, held) if held > count and len(names) == count else None
    if rows is None:
        raise RecordingError(
            f"{source}: {held} poses for {count} scans, and the numbers in the names of the scans do not say which are "
            "missing; give one pose a scan"
        )
    return rows


def _from_tum(rows: np.ndarray, file: Path, count: int, stamp_s: np.ndarray | None) -> np.ndarray:
    norm = np.linalg.norm(rows[:, 4:], axis=1)
    if (np.abs(norm - 1) > 0.01).any():
        row = int(np.abs(norm - 1).argmax())
        raise RecordingError(f"{file}:{row + 1}: quaternion of length {norm[row]:.3g}; write qx qy qz qw of length 1")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(rows[:, 4:]).as_matrix()
    poses[:, :3, 3] = rows[:, 1:4]
    if len(rows) == count:
        return poses
    time = _in_clock_of(rows[:, 0], stamp_s)
    if stamp_s is None or np.any(np.diff(time) <= 0) or stamp_s[0] < time[0] - 0.2 or stamp_s[-1] > time[-1] + 0.2:
        raise RecordingError(f"{file}: {len(rows)} poses for {count} scans, {_why_apart(time, stamp_s)}")
    at = np.clip(stamp_s, time[0], time[-1])
    found = np.tile(np.eye(4), (count, 1, 1))
    found[:, :3, :3] = Slerp(time, Rotation.from_quat(rows[:, 4:]))(at).as_matrix()
    found[:, :3, 3] = np.stack([np.interp(at, time, rows[:, axis]) for axis in (1, 2, 3)], 1)
    return found


def _in_clock_of(time: np.ndarray, stamp_s: np.ndarray | None) -> np.ndarray:
    """Times of poses in the unit of the scans' stamps, where exactly one of s, ms, µs and ns makes them overlap."""
    if stamp_s is None or len(time) < 2:
        return time
    units = [unit for unit in (1.0, 1e-3, 1e-6, 1e-9) if _overlap(time * unit, stamp_s)]
    return time * units[0] if len(units) == 1 else time


def _overlap(time: np.ndarray, stamp_s: np.ndarray) -> bool:
    return bool(time.min() <= stamp_s[0] + 0.2 and time.max() >= stamp_s[-1] - 0.2)


def _why_apart(time: np.ndarray, stamp_s: np.ndarray | None) -> str:
    if stamp_s is None:
        return "and scans have no stamps to choose them by; give one pose per scan, or times.txt next to the scans"
    if np.any(np.diff(time) <= 0):
        row = int(np.argmax(np.diff(time) <= 0)) + 1
        return f"and the time of pose {row + 1} is not later than the one before; sort the file by time"
    return (
        f"and their times ({time[0]:.3f} to {time[-1]:.3f} s) do not span the scans' ({stamp_s[0]:.3f} to "
        f"{stamp_s[-1]:.3f} s), so the clocks differ; give both in one clock, or one pose a scan"
    )


def _camera_from_lidar(folder: Path) -> np.ndarray | None:
    """KITTI's `calib.txt`: Tr of odometry, or R0_rect · Tr_velo_to_cam of the object benchmark; None without either."""
    file = folder / "calib.txt"
    if not file.is_file():
        return None
    given = _matrices(file, ("Tr", "Tr_velo_to_cam", "Tr_velo_cam", "R0_rect", "R_rect"))
    moved = next((values for name, values in given.items() if values.size == 12), None)
    if moved is None:
        return None
    pose, rectified = np.eye(4), np.eye(4)
    pose[:3] = moved.reshape(3, 4)
    rectified[:3, :3] = next((values for values in given.values() if values.size == 9), np.eye(3)).reshape(3, 3)
    return rectified @ pose


def _matrices(file: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """The named rows of a calibration, flat."""
    found = {}
    for line in read_text(file).splitlines():
        key, _, rest = line.replace(":", " ", 1).partition(" ")
        if key in names:
            found[key] = np.array(numbers(rest.split(), f"{file}: {key}"))
    return found


def _demand_ahead(poses: np.ndarray, file: Path) -> None:
    """Raise where the path runs along the sensor's z axis, as it does for a camera."""
    step = np.einsum("nji,nj->ni", poses[:-1, :3, :3], np.diff(poses[:, :3, 3], axis=0))
    length = float(np.linalg.norm(step, axis=1).sum())
    if length > 1.0 and float(np.abs(step[:, 2]).sum()) > _AHEAD_SHARE * length:
        raise RecordingError(
            f"{file}: the path runs along z, in camera axes (z forward); give poses in sensor axes, x forward "
            "and z up, or put KITTI's calib.txt with Tr next to it"
        )
