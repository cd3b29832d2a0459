"""Cut and shift lines as SUMO does. Lengths are horizontal."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from shapely.ops import substring


def length(line: np.ndarray) -> float:
    """Return the length in metres of a (k, 3) line."""
    return float(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1).sum())


def beside(line: np.ndarray, right_m: float, start_m: float = 0.0, end_m: float = np.inf) -> np.ndarray:
    """Return the line that runs to the right of (a part of) a (k, 3) line, without folds at its bends.

    Args:
        line: the line.
        right_m: lateral offset to the right; negative to the left.
        start_m, end_m: the part, distances from the line's start.
    """
    middle = shapely.LineString(line[:, :2])
    moved = middle.offset_curve(-right_m, join_style="mitre")
    moved = max(shapely.get_parts(moved), key=lambda part: part.length, default=middle)
    start, end = (moved.project(middle.interpolate(min(at, middle.length))) for at in (start_m, end_m))
    xy = np.array(substring(moved, start, end).coords)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))])
    return np.column_stack([xy, np.interp(middle.project(shapely.points(xy)), along, line[:, 2])])


def strip(line: np.ndarray, width_m: float) -> np.ndarray:
    """Return the (k, 3) outline of a strip around a (j, 3) line, counter-clockwise."""
    return np.vstack([beside(line, width_m / 2), beside(line, -width_m / 2)[::-1]])


def densify(line: np.ndarray, step_m: float) -> np.ndarray:
    """Return a (k, 2 or 3) line with points added wherever two are farther apart than a step."""
    pieces = [
        a + np.linspace(0, 1, max(1, int(np.ceil(np.linalg.norm(b - a) / step_m))), endpoint=False)[:, None] * (b - a)
        for a, b in pairwise(line)
    ]
    return np.vstack([*pieces, line[-1:]])


def heading(line: np.ndarray) -> float:
    """Return the direction of a line's last piece, radians counter-clockwise from east."""
    step = np.diff(line[:, :2], axis=0)
    dx, dy = step[np.linalg.norm(step, axis=1) > 1e-6][-1]
    return float(np.arctan2(dy, dx))
