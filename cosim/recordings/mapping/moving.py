"""Moving objects: surfels that some beams passed through and others hit.

A vote over beams in range images, as Kim and Kim, Remove, then revert: static point cloud map construction using
multiresolution range images, IROS 2020: a surfel that lies well in front of everything that was measured about its
direction was not there at that time. Nor was one where beams were sent and none came back, as from the sky behind a
van, though nearer and less grazing ones do come back.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.ndimage import minimum_filter

from cosim.recordings.mapping.surfels import Surfels

_PIXEL_DEG = 0.8
_SHAPE = (round(180 / _PIXEL_DEG), round(360 / _PIXEL_DEG))
_FARTHEST_M = 40.0
_CLEAR_M, _CLEAR_SHARE = 0.5, 0.03  # how far behind the surfel everything must lie
_LEAST_FREE = 3
_FREE_SHARE = 0.4  # of the scans that looked there


class FreeSpace:
    """Counts, scan by scan, which surfels were there and which were passed through.

    Args:
        surfels: of the whole map.
        looked: pixels into which beams are sent, see `looked_at`.
    """

    def __init__(self, surfels: Surfels, looked: np.ndarray) -> None:
        self._surfels, self._looked = surfels, looked
        self.free = np.zeros(len(surfels), int)
        self.hit = np.zeros(len(surfels), int)

    def add(self, xyz: np.ndarray, pose: np.ndarray) -> None:
        """Count a scan: points (n, 3) in the sensor's axes at the pose time, pose (4, 4)."""
        row, column, away = _pixels(xyz)
        image = np.full(_SHAPE, np.inf)
        np.minimum.at(image, (row, column), away)
        nearest = minimum_filter(image, size=3, mode="wrap")
        local = (self._surfels.centre - pose[:3, 3]) @ pose[:3, :3]
        row, column, away = _pixels(local)
        seen, met = nearest[row, column], image[row, column]
        near = away < _FARTHEST_M
        margin = _CLEAR_M + _CLEAR_SHARE * away
        nothing = np.isinf(seen) & self._looked[row, column] & self._would_return(local, away, pose)
        self.free += near & ((np.isfinite(met) & (seen > away + margin)) | nothing)
        self.hit += near & (np.abs(met - away) < margin)

    def _would_return(self, local: np.ndarray, away: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """(m,) bool: which surfels lie no farther and no more grazing than when they were seen."""
        slope = np.abs(np.einsum("ij,ij->i", local, self._surfels.normal @ pose[:3, :3])) / np.maximum(away, 1e-6)
        return (away <= self._surfels.range_m[:, 1]) & (slope >= self._surfels.cos_incidence[:, 1])

    def moving(self) -> np.ndarray:
        """(m,) bool: which surfels are of something that moves."""
        looks = self.free + self.hit
        return (self.free >= _LEAST_FREE) & (self.free > _FREE_SHARE * looks)


def looked_at(scans: Iterable[np.ndarray]) -> np.ndarray:
    """Pixels (rows, columns), bool, into which a sensor sends beams: those with a return in any scan (n, 3)."""
    looked = np.zeros(_SHAPE, bool)
    for xyz in scans:
        row, column, _ = _pixels(xyz)
        looked[row, column] = True
    return looked


def _pixels(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    away = np.linalg.norm(xyz, axis=1)
    elevation = np.arcsin(np.clip(xyz[:, 2] / np.maximum(away, 1e-6), -1, 1))
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    row = np.clip(((np.pi / 2 - elevation) / np.pi * _SHAPE[0]).astype(int), 0, _SHAPE[0] - 1)
    column = ((azimuth + np.pi) / (2 * np.pi) * _SHAPE[1]).astype(int) % _SHAPE[1]
    return row, column, away
