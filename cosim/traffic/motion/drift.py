"""Sideways ways: how a vehicle leaves or reaches SUMO's line where that jumps."""

from __future__ import annotations

import numpy as np

JUMP_M = 0.3
_SHORTEST_M = 10.0
_CHANGE_S = 3.0


def lateral_jump(moved: np.ndarray, course_rad: np.ndarray, distance_m: np.ndarray) -> np.ndarray:
    """Lateral jump (n,) of SUMO's position to the left, 0 if it moved along its course.

    Args:
        moved: (n, 2) from the last position to this one.
        course_rad: (n,) SUMO's heading, the mean of both.
        distance_m: (n,) that the speed accounts for.
    """
    left = moved[:, 1] * np.cos(course_rad) - moved[:, 0] * np.sin(course_rad)
    return np.where(np.abs(left) > JUMP_M + 0.75 * distance_m, left, 0.0)


def smooth(share: np.ndarray) -> np.ndarray:
    """Remaining share of an offset after a share of the way: 1 to 0 with smooth ends (Flash & Hogan 1985)."""
    u = np.clip(share, 0, 1)
    return 1 - u**3 * (10 - 15 * u + 6 * u * u)


def steep(share: np.ndarray) -> np.ndarray:
    """Remaining share if the wheels are turned at the start: steep first, then ending along the lane."""
    return (1 - np.clip(share, 0, 1)) ** 2


def change_length(speed_mps: np.ndarray) -> np.ndarray:
    """Way that a change of lane takes at a speed [m]."""
    return np.maximum(_SHORTEST_M, _CHANGE_S * speed_mps)
