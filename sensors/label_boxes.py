"""Labelled boxes and the points in them, as label effects see them."""

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
        half = self.size[row] / 2
        near = self._nearby
        offset = near - (self.centre[row] + [0, 0, lift_m])
        close = np.flatnonzero((np.abs(offset[:, :2]) <= np.hypot(half[0], half[1])).all(1))
        offset = offset[close]
        cos, sin = np.cos(self.yaw[row]), np.sin(self.yaw[row])
        x, y = offset[:, 0], offset[:, 1]
        local = np.stack([cos * x + sin * y, cos * y - sin * x, offset[:, 2]], 1)
        return local[(np.abs(local) <= half).all(1)]

    @cached_property
    def _nearby(self) -> np.ndarray:
        """Points within the upright hull of all boxes, (k, 3) float32: most of a scan is elsewhere."""
        if not len(self):
            return self.points[:0]
        reach = np.hypot(self.size[:, 0], self.size[:, 1])[:, None]
        low = (self.centre[:, :2] - reach).min(0)
        high = (self.centre[:, :2] + reach).max(0)
        x, y = self.points[:, 0], self.points[:, 1]
        return self.points[(x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1])]
