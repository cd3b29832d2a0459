"""Cutting and shifting lines the way SUMO does."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

_SAME_POINT_M = 0.05


def length(line: np.ndarray) -> float:
    """Return the length in metres of a (k, 3) line, seen from above."""
    return float(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1).sum())


def beside(line: np.ndarray, start_m: float, end_m: float, right_m: float) -> np.ndarray:
    """Return the line that runs to the right of a part of a (k, 3) line; heights stay.

    The whole line is moved aside before it is cut: a short piece at a bend may be shorter than the bend takes away.

    Args:
        line: the line.
        start_m, end_m: the part, distances from the line's start seen from above.
        right_m: how far aside.
    """
    line = _without_repeats(line)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))])
    start_m, end_m = np.clip([start_m, end_m], 0.0, along[-1])
    inner = along[(along > start_m + _SAME_POINT_M) & (along < end_m - _SAME_POINT_M)]
    at = np.concatenate([[start_m], inner, [end_m]])
    moved = shift_right(line, right_m)
    return np.stack([np.interp(at, along, moved[:, axis]) for axis in range(3)], axis=1)


def densify(line: np.ndarray, step_m: float) -> np.ndarray:
    """Return a (k, 2 or 3) line with points added wherever two are farther apart than a step."""
    pieces = [
        a + np.linspace(0, 1, max(1, int(np.ceil(np.linalg.norm(b - a) / step_m))), endpoint=False)[:, None] * (b - a)
        for a, b in pairwise(line)
    ]
    return np.vstack([*pieces, line[-1:]])


def shift_right(line: np.ndarray, distance_m: float) -> np.ndarray:
    """Return a (k, 3) line moved sideways, every piece by the same distance; heights stay."""
    line = _without_repeats(line)
    if len(line) < 2:
        return line
    step = np.diff(line[:, :2], axis=0)
    right = np.stack([step[:, 1], -step[:, 0]], axis=1) / np.linalg.norm(step, axis=1, keepdims=True)
    before, after = np.vstack([right[:1], right]), np.vstack([right, right[-1:]])
    mitre = (before + after) / np.maximum(1 + (before * after).sum(axis=1, keepdims=True), 0.2)
    return np.column_stack([line[:, :2] + distance_m * mitre, line[:, 2]])


def _without_repeats(line: np.ndarray) -> np.ndarray:
    moves = np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1) > 1e-6
    return line[np.concatenate([[True], moves])]


def strip(line: np.ndarray, width_m: float) -> np.ndarray:
    """Return the (2k, 3) outline of a strip around a (k, 3) line, counter-clockwise."""
    return np.vstack([shift_right(line, width_m / 2), shift_right(line, -width_m / 2)[::-1]])


def heading(line: np.ndarray) -> float:
    """Return the direction of a line's last piece, radians counter-clockwise from east."""
    dx, dy = np.diff(_without_repeats(line)[-2:, :2], axis=0)[0]
    return float(np.arctan2(dy, dx))
