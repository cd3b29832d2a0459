"""The camera image at the pose time, for effects that derive intensities from it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

_NEAR_M = 0.5
_MISSED_M, _MISSED_SHARE = 0.15, 0.02  # a road seen at 60 m is 0.9 m farther away half a pixel up
_SURROUNDINGS_PX = 41


@dataclass(frozen=True, eq=False)
class CameraView:
    """One camera's images, pixel-aligned.

    Attributes:
        gray: (h, w) uint8 grayscale image.
        depth_m: (h, w) float32 depth along the optical axis, 0 where there is nothing.
        P: (3, 4) float64 projection from rectified camera-0 axes (x right, y down, z forward) to pixels.
        pose: (4, 4) float64 world pose of those axes.
    """

    gray: np.ndarray
    depth_m: np.ndarray
    P: np.ndarray
    pose: np.ndarray

    @property
    def forward(self) -> np.ndarray:
        """Unit vector of the optical axis, (3,) float32 world axes."""
        return self.pose[:3, 2].astype(np.float32)

    def pixels(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixel coordinates of points.

        Args:
            points: (n, 3) float64 world axes.

        Returns:
            Columns u and rows v (n,) float32, meaningful where the depth is positive, and depths (n,) float32 [m].
        """
        rotation, centre = self.pose[:3, :3], self.pose[:3, 3]
        # Relative to the camera first: float32 keeps its digits near the origin only.
        turned = (self.P[:, :3] @ rotation.T).astype(np.float32)
        projected = (points - centre).astype(np.float32) @ turned.T + self.P[:, 3].astype(np.float32)
        depth = projected[:, 2]
        safe = np.where(depth > _NEAR_M, depth, np.float32(np.inf))
        return projected[:, 0] / safe, projected[:, 1] / safe, depth

    def visible(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points that the camera sees, and their pixels.

        A point is seen where one of the four pixels around its projection has its depth, within 0.15 m + 2 %.

        Args:
            points: (n, 3) float64 world axes.

        Returns:
            Rows of the seen points (k,), and their pixels' rows and columns (k,).
        """
        u, v, depth = self.pixels(points)
        height, width = self.gray.shape
        rows = np.flatnonzero((depth > _NEAR_M) & (u >= 0) & (v >= 0) & (u < width - 1) & (v < height - 1))
        left, top, z = u[rows].astype(np.int32), v[rows].astype(np.int32), depth[rows]
        best = np.full(len(rows), np.inf, np.float32)
        column, line = left.copy(), top.copy()
        for dv in (0, 1):
            for du in (0, 1):
                miss = np.abs(self.depth_m[top + dv, left + du] - z)
                nearer = miss < best
                best = np.where(nearer, miss, best)
                column, line = np.where(nearer, left + du, column), np.where(nearer, top + dv, line)
        seen = best <= _MISSED_M + _MISSED_SHARE * z
        return rows[seen], line[seen], column[seen]

    def peaks(self, threshold: float, contrast: float) -> np.ndarray:
        """Pixels that are brighter than their surroundings, (h, w) bool.

        Args:
            threshold: least brightness, 0–1.
            contrast: how much brighter than the mean of the 41 × 41 pixels around, 0–1.
        """
        bright = self.gray >= np.float32(threshold * 255)
        mean = cv2.blur(self.gray, (_SURROUNDINGS_PX, _SURROUNDINGS_PX))
        return bright & (self.gray.astype(np.int16) - mean >= contrast * 255)
