"""What moves: surfels that beams passed through while others hit them.

A vote over beams in range images, as Kim and Kim, Remove, then revert: static point cloud map construction using
multiresolution range images, IROS 2020: a surfel that lies well in front of everything that was measured about its
direction was not there at that time.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter

from cosim.recordings.mapping.surfels import Surfels

_PIXEL_DEG = 0.8
_FARTHEST_M = 40.0
_CLEAR_M, _CLEAR_SHARE = 0.5, 0.03  # how far behind the surfel everything must lie
_LEAST_FREE = 3
_FREE_SHARE = 0.4  # of the scans that looked there


class FreeSpace:
    """Counts, scan by scan, which surfels were there and which were passed through.

    Args:
        surfels: of the whole map.
    """

    def __init__(self, surfels: Surfels) -> None:
        self._surfels = surfels
        self.free = np.zeros(len(surfels), int)
        self.hit = np.zeros(len(surfels), int)

    def add(self, xyz: np.ndarray, pose: np.ndarray) -> None:
        """Count a scan: points (n, 3) in the sensor's axes at the pose time, pose (4, 4)."""
        shape = (round(180 / _PIXEL_DEG), round(360 / _PIXEL_DEG))
        row, column, away = _pixels(xyz, shape)
        image = np.full(shape, np.inf)
        np.minimum.at(image, (row, column), away)
        nearest = minimum_filter(image, size=3, mode="wrap")
        local = (self._surfels.centre - pose[:3, 3]) @ pose[:3, :3]
        row, column, away = _pixels(local, shape)
        seen = nearest[row, column]
        near = (away < _FARTHEST_M) & np.isfinite(image[row, column])
        margin = _CLEAR_M + _CLEAR_SHARE * away
        self.free += near & (seen > away + margin)
        self.hit += near & (np.abs(image[row, column] - away) < margin)

    def moving(self) -> np.ndarray:
        """(m,) bool: which surfels are of something that moves."""
        looks = self.free + self.hit
        return (self.free >= _LEAST_FREE) & (self.free > _FREE_SHARE * looks)


def _pixels(xyz: np.ndarray, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    away = np.linalg.norm(xyz, axis=1)
    elevation = np.arcsin(np.clip(xyz[:, 2] / np.maximum(away, 1e-6), -1, 1))
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    row = np.clip(((np.pi / 2 - elevation) / np.pi * shape[0]).astype(int), 0, shape[0] - 1)
    column = ((azimuth + np.pi) / (2 * np.pi) * shape[1]).astype(int) % shape[1]
    return row, column, away
