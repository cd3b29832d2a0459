"""Rigid motion: where the sensor is at any time of a sweep, and points carried to its pose time."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def scan_times(azimuth_rad: np.ndarray, time_s: np.ndarray | None, sweep_s: float) -> np.ndarray:
    """Time (n,) [s] of each point from the pose time, at which the head faces forward.

    Args:
        azimuth_rad: (n,) of the points.
        time_s: (n,) from the earliest point if the recording has times; otherwise −azimuth/2π of a sweep.
        sweep_s: duration of a turn, clockwise seen from above.
    """
    ahead = np.abs(azimuth_rad) < np.radians(2)
    if time_s is None or not ahead.any():
        return -azimuth_rad / (2 * np.pi) * sweep_s
    return time_s - float(np.median(time_s[ahead]))


def between(pose: np.ndarray, later: np.ndarray) -> np.ndarray:
    """The motion (6,) from one pose (4, 4) to a later one, in the axes of the first: rotation vector, translation."""
    step = np.linalg.inv(pose) @ later
    return np.concatenate([Rotation.from_matrix(step[:3, :3]).as_rotvec(), step[:3, 3]])


def motions(poses: np.ndarray, turns: np.ndarray | None = None) -> np.ndarray:
    """The motion (n, 6) in a sweep at poses (n, 4, 4): of central differences, of one side at the ends.

    Args:
        poses: of the scans.
        turns: (n,) sweeps since the first scan; by default scans follow each other.
    """
    count = len(poses)
    turns = np.arange(count, dtype=float) if turns is None else turns
    if count < 2:
        return np.zeros((count, 6))
    found = []
    for row in range(count):
        first, last = max(row - 1, 0), min(row + 1, count - 1)
        step = np.linalg.inv(poses[first]) @ poses[last]
        sweeps, before = max(turns[last] - turns[first], 0.5), turns[row] - turns[first]
        turned = Rotation.from_matrix(step[:3, :3]).as_rotvec() / sweeps
        back = Rotation.from_rotvec(-before * turned).as_matrix()
        found.append(np.concatenate([turned, back @ step[:3, 3] / sweeps]))
    return np.array(found)


def deskewed(xyz: np.ndarray, share: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Points (n, 3) in the sensor's axes at the pose time.

    Args:
        xyz: (n, 3) as measured, each in the sensor's axes at its own time.
        share: (n,) times from the pose time, in sweeps.
        motion: (6,) of the sensor in a sweep, see `between`. R(t) = exp(t·ω), p(t) = t·v: exact to the second order
            in the angle turned within half a sweep.
    """
    angle = share[:, None] * motion[:3]
    turned = Rotation.from_rotvec(angle).apply(xyz) if np.abs(motion[:3]).max() > 1e-9 else xyz
    return turned + share[:, None] * motion[3:]


def applied(pose: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """Points (n, 3) carried by a pose (4, 4)."""
    return xyz @ pose[:3, :3].T + pose[:3, 3]


def nudged(pose: np.ndarray, change: np.ndarray) -> np.ndarray:
    """A pose after a small turn and shift (6,) in world axes about the pose's own place."""
    moved = pose.copy()
    moved[:3, :3] = Rotation.from_rotvec(change[:3]).as_matrix() @ pose[:3, :3]
    moved[:3, 3] += change[3:]
    return moved
