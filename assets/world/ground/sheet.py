"""Height of the ground at any point, interpolated in its triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import Delaunay, KDTree

if TYPE_CHECKING:
    from scipy.interpolate import LinearNDInterpolator

_WITHIN_M = 1e-6


@dataclass(frozen=True, eq=False)
class Sheet:
    """A surface of triangles over the plane, z(x, y), flat between its corners.

    Attributes:
        triangles: of n points in the plane, world metres.
        z: (n,) heights [m].
    """

    triangles: Delaunay
    z: np.ndarray

    @cached_property
    def _between(self) -> LinearNDInterpolator:
        from scipy.interpolate import LinearNDInterpolator

        return LinearNDInterpolator(self.triangles, self.z)

    def __call__(self, xy: np.ndarray) -> np.ndarray:
        """Heights (n,) float64 in metres at world points `xy` (n, 2); beyond the edge the edge's height."""
        low, high = self.triangles.min_bound + _WITHIN_M, self.triangles.max_bound - _WITHIN_M
        places = np.clip(np.asarray(xy, np.float64).reshape(-1, 2), low, high)
        heights = self._between(places)
        lost = np.isnan(heights)
        if lost.any():  # no triangle is found where a network has corners that nearly coincide
            heights[lost] = self.z[KDTree(self.triangles.points).query(places[lost])[1]]
        return heights
