"""Labelled boxes and the points in them, for label effects."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True, eq=False)
class LabelBoxes:
    """Upright boxes of the labelled objects of one frame, LiDAR axes.

    Attributes:
        kinds: n class names as in KITTI.
        centre: (n, 3) float64 centres [m].
        size: (n, 3) float64 length (along the heading), width, height [m].
        yaw: (n,) float64 heading [rad], counter-clockwise from +x.
        kept: (n,) bool; the others become DontCare regions.
        points: (m, 3) float32 points of the scan.
    """

    kinds: tuple[str, ...]
    centre: np.ndarray
    size: np.ndarray
    yaw: np.ndarray
    kept: np.ndarray
    points: np.ndarray

    def __len__(self) -> int:
        return len(self.kinds)

    def local_points(self, row: int, lift_m: float = 0.0) -> np.ndarray:
        """The scan's points in one box, (k, 3) float64 along its length, width and height from its centre.

        Args:
            row: of the box.
            lift_m: how much the box is lifted first, so that the road stays outside.
        """
        half, (x, y, z) = self.size[row] / 2, self._nearby
        centre, reach = self.centre[row], np.hypot(*half[:2])
        close = np.flatnonzero(np.abs(x - np.float32(centre[0])) <= reach + 0.01)
        close = close[np.abs(y[close] - np.float32(centre[1])) <= reach + 0.01]
        along, across, up = x[close] - centre[0], y[close] - centre[1], z[close] - (centre[2] + lift_m)
        cos, sin = np.cos(self.yaw[row]), np.sin(self.yaw[row])
        along, across = cos * along + sin * across, cos * across - sin * along
        inside = (np.abs(along) <= half[0]) & (np.abs(across) <= half[1]) & (np.abs(up) <= half[2])
        return np.stack([along[inside], across[inside], up[inside]], 1)

    @cached_property
    def _nearby(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates of the points within the upright hull of all boxes, (k,) each: most of a scan is elsewhere."""
        if not len(self):
            return (np.empty(0), np.empty(0), np.empty(0))
        reach = np.hypot(self.size[:, 0], self.size[:, 1])[:, None] + 0.01
        low, high = (self.centre[:, :2] - reach).min(0), (self.centre[:, :2] + reach).max(0)
        x, y = self.points[:, 0], self.points[:, 1]
        near = np.flatnonzero((x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1]))
        return (x[near], y[near], self.points[near, 2])
