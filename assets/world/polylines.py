"""Polylines in the plane: stations, offsets and dashes."""

from __future__ import annotations

import numpy as np


def stations(line: np.ndarray) -> np.ndarray:
    """Distance (k,) of every vertex of `line` (k, ≥2) from its start, measured in plan."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))])


def at(line: np.ndarray, station_m: np.ndarray) -> np.ndarray:
    """Points (n, 2) at distances `station_m` (n,) along `line`."""
    along = stations(line)
    return np.stack([np.interp(station_m, along, line[:, k]) for k in (0, 1)], axis=1)


def headings(line: np.ndarray, station_m: np.ndarray) -> np.ndarray:
    """Unit directions (n, 2) at distances along `line`."""
    ahead, behind = at(line, station_m + 0.3), at(line, station_m - 0.3)
    direction = ahead - behind
    return direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)


def offset(line: np.ndarray, left_m: float) -> np.ndarray:
    """The line (k, 2) shifted to its left, mitred at the corners."""
    direction = np.diff(line[:, :2], axis=0)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
    before, after = np.vstack([direction[:1], direction]), np.vstack([direction, direction[-1:]])
    normal = (before + after)[:, ::-1] * [-1.0, 1.0]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    across = np.maximum((normal * (after[:, ::-1] * [-1.0, 1.0])).sum(1, keepdims=True), 0.5)
    return line[:, :2] + normal * left_m / across


def dashes(line: np.ndarray, dash_m: float, gap_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends (n, 2) of dashes along `line`; `gap_m` 0 gives one unbroken run of short pieces."""
    length = float(stations(line)[-1])
    begin = np.arange(gap_m / 2, length - 0.3, dash_m + gap_m)
    return at(line, begin), at(line, np.minimum(begin + dash_m, length))


def solid(line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends of the line's own segments."""
    return line[:-1, :2], line[1:, :2]
