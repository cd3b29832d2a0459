"""The ground's height at any place: as its triangles have it, no matter how uneven they are."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay, KDTree

_WITHIN_M = 1e-6


class Sheet:
    """A surface of triangles over the plane, z(x, y), flat between its corners.

    Args:
        triangles: of n points in the plane, world metres.
        z: (n,) heights [m].
    """

    def __init__(self, triangles: Delaunay, z: np.ndarray) -> None:
        self.z = z
        self._low, self._high = triangles.min_bound + _WITHIN_M, triangles.max_bound - _WITHIN_M
        self._corners = triangles.points
        self._between = LinearNDInterpolator(triangles, z)

    def __call__(self, xy: np.ndarray) -> np.ndarray:
        """Heights (n,) float64 in metres at world points `xy` (n, 2); beyond the edge the edge's height."""
        places = np.clip(np.asarray(xy, np.float64).reshape(-1, 2), self._low, self._high)
        heights = self._between(places)
        lost = np.isnan(heights)
        if lost.any():  # no triangle is found where a network has corners that nearly coincide
            heights[lost] = self.z[KDTree(self._corners).query(places[lost])[1]]
        return heights
