"""Direction of gravity, pose of the sensor on its vehicle, and the surfels of the ground."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from cosim.recordings.mapping.surfels import Surfels
from cosim.recordings.settings import RecordingMount

_NEAR_PATH_M = 15.0
_BELOW_M = (0.3, 6.0)
_GROUND_BAND_M = 0.3


def up(surfels: Surfels, poses: np.ndarray) -> np.ndarray:
    """The mean normal (3,) of the ground near the path, in the axes of the map."""
    near = KDTree(poses[:, :2, 3]).query(surfels.centre[:, :2])[0] < _NEAR_PATH_M
    ground = near & surfels.level()
    if ground.sum() < 20:
        return np.array([0.0, 0.0, 1.0])
    mean = (surfels.normal[ground] * surfels.points[ground, None]).sum(0)
    return mean / np.linalg.norm(mean)


def levelled(
    surfels: Surfels, poses: np.ndarray, up: np.ndarray, mount: RecordingMount | None
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Poses in a world with z up and ground about 0, the sensor's pose on the vehicle, and whether it is known."""
    turn = np.eye(4)
    turn[:3, :3] = _tilt_to_z(up)
    poses = turn @ poses
    if mount is not None:
        height, known = mount.height_m, True
        tilt = Rotation.from_euler("yx", [mount.pitch_deg, mount.roll_deg], degrees=True).as_matrix()
    else:
        tilt = _tilt_to_z(np.mean(poses[:, 2, :3], axis=0))
        found = _height(surfels, poses, turn)
        height, known = (found, True) if found is not None else (1.8, False)
    pose_ego = np.eye(4)
    pose_ego[:3, :3], pose_ego[2, 3] = tilt, height
    poses[:, 2, 3] += height - poses[0, 2, 3]
    return poses, pose_ego, known


def _tilt_to_z(up: np.ndarray) -> np.ndarray:
    """The smallest rotation (3, 3) that carries a direction to z."""
    up = up / np.linalg.norm(up)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    length = float(np.linalg.norm(axis))
    return Rotation.from_rotvec(axis / max(length, 1e-12) * np.arctan2(length, up[2])).as_matrix()


def _height(surfels: Surfels, poses: np.ndarray, turn: np.ndarray) -> float | None:
    """Height of the sensor above the ground about its path [m]; None where there is no ground."""
    centre = surfels.centre @ turn[:3, :3].T
    away, row = KDTree(poses[:, :2, 3]).query(centre[:, :2])
    below = poses[row, 2, 3] - centre[:, 2]
    rows = (away < _NEAR_PATH_M) & surfels.level() & (below > _BELOW_M[0]) & (below < _BELOW_M[1])
    if rows.sum() < 20:
        return None
    counts, edges = np.histogram(
        below[rows], np.arange(_BELOW_M[0], _BELOW_M[1] + 0.1, 0.1), weights=surfels.points[rows]
    )
    usual = edges[counts.argmax()] + 0.05
    return float(np.median(below[rows][np.abs(below[rows] - usual) < 0.15]))


def ground(surfels: Surfels, poses: np.ndarray, height_m: float) -> np.ndarray:
    """(m,) bool: flat surfels at the ground's height below the nearest pose, farther ones within a slope of 1 in 20."""
    away, row = KDTree(poses[:, :2, 3]).query(surfels.centre[:, :2])
    above = surfels.centre[:, 2] - (poses[row, 2, 3] - height_m)
    return surfels.level() & (np.abs(above) < _GROUND_BAND_M + 0.05 * away)
