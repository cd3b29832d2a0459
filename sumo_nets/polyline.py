"""Cutting and shifting lines the way SUMO does."""

from __future__ import annotations

import numpy as np


def length(line: np.ndarray) -> float:
    """Return the length in metres of a (k, 3) line, seen from above."""
    return float(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1).sum())


def cut(line: np.ndarray, start_m: float, end_m: float) -> np.ndarray:
    """Return the part of a (k, 3) line between two distances from its start."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))])
    start_m, end_m = np.clip([start_m, end_m], 0.0, along[-1])
    inner = along[(along > start_m + 1e-6) & (along < end_m - 1e-6)]
    at = np.concatenate([[start_m], inner, [end_m]])
    return np.stack([np.interp(at, along, line[:, axis]) for axis in range(line.shape[1])], axis=1)


def shift_right(line: np.ndarray, distance_m: float) -> np.ndarray:
    """Return a (k, 3) line moved sideways, every piece by the same distance; heights stay."""
    step = np.diff(line[:, :2], axis=0)
    step = step[np.linalg.norm(step, axis=1) > 1e-9]
    if len(step) == 0:
        return line.copy()
    line = line[np.concatenate([[True], np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1) > 1e-9])]
    right = np.stack([step[:, 1], -step[:, 0]], axis=1) / np.linalg.norm(step, axis=1, keepdims=True)
    before, after = np.vstack([right[:1], right]), np.vstack([right, right[-1:]])
    mitre = (before + after) / np.maximum(1 + (before * after).sum(axis=1, keepdims=True), 0.2)
    return np.column_stack([line[:, :2] + distance_m * mitre, line[:, 2]])


def strip(line: np.ndarray, width_m: float) -> np.ndarray:
    """Return the (2k, 3) outline of a strip around a (k, 3) line, counter-clockwise."""
    return np.vstack([shift_right(line, width_m / 2), shift_right(line, -width_m / 2)[::-1]])


def heading(line: np.ndarray) -> float:
    """Return the direction of a line's last piece, radians counter-clockwise from east."""
    step = np.diff(line[:, :2], axis=0)
    dx, dy = step[np.linalg.norm(step, axis=1) > 1e-9][-1]
    return float(np.arctan2(dy, dx))
