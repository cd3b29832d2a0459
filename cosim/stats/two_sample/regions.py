"""Region of each cell of a scan: labelled objects by their boxes, the rest by its shape, with one rule for all sets."""

from __future__ import annotations

import numpy as np

REGIONS = ("ground", "objects", "flat", "scattered")
TITLES = {
    "ground": "ground",
    "objects": "labelled objects",
    "flat": "upright flat surfaces (façades, walls)",
    "scattered": "scattered surfaces (vegetation, poles, clutter)",
}
_CELL_M = 2.0
_ABOVE_GROUND_M = 0.25
_FLAT_M = 0.06
_FLAT_SHARE = 0.03  # of range: what a flat surface seen aslant steps by from beam to beam


def region_of_cells(points: np.ndarray, table: np.ndarray, on_object: np.ndarray) -> np.ndarray:
    """Region of each cell, (rows, columns) int8; −1 where there is no return.

    Ground is what lies within 0.25 m of the lowest points of its neighbourhood of 2 m, filled from nearer cells of the
    scan. Above it, a cell is flat where the range runs on evenly through its neighbours along the row, else scattered.

    Args:
        points: (n, ≥ 3) in LiDAR axes.
        table: (rows, columns) row of the point in each cell, −1 for none.
        on_object: (n,) bool whether a point lies in a labelled box.
    """
    there = table >= 0
    region = np.full(table.shape, -1, np.int8)
    height = points[:, 2] - _ground_height(points)
    range_m = np.where(there, np.linalg.norm(points[table, :3], axis=-1), np.nan)
    bend = np.full(table.shape, np.inf)
    bend[:, 1:-1] = np.abs(np.diff(range_m, 2, axis=1))
    bend = np.where(np.isfinite(bend), bend, np.inf)
    region[there] = np.where((bend < np.maximum(_FLAT_M, _FLAT_SHARE * 0.1 * range_m))[there], 2, 3)
    region[there & (height[table] < _ABOVE_GROUND_M)] = 0
    region[there & on_object[table]] = 1
    return region


def _ground_height(points: np.ndarray) -> np.ndarray:
    """Height of the ground under each point, (n,): the lowest point of its cell of 2 m and of the eight around it."""
    position = np.floor(points[:, :2] / _CELL_M).astype(np.int64)
    position -= position.min(0)
    width = int(position[:, 1].max()) + 3
    cell = (position[:, 0] + 1) * width + position[:, 1] + 1
    floor = np.full((int(position[:, 0].max()) + 3) * width, np.inf)
    np.minimum.at(floor, cell, points[:, 2].astype(np.float64))
    around = [floor[cell + down * width + right] for down in (-1, 0, 1) for right in (-1, 0, 1)]
    return np.min(around, axis=0)
