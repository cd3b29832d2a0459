"""Ground surface under wheels and feet."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from sensors.bvh import Bvh

_ABOVE_M = 1.5
_BELOW_M = 6.0


class Ground:
    """Height queries on a ground mesh.

    Args:
        mesh: road, kerbs, pavements and terrain, in world axes.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._bvh = Bvh(mesh)

    def height(self, points: np.ndarray) -> np.ndarray:
        """Height of the surface under (or just above) each point.

        Args:
            points: (n, 3) world positions near the surface; the search runs from 1.5 m above to 4.5 m below.

        Returns:
            (n,) float64 world z; the point's own z where no surface is found.
        """
        surface, is_hit = self._trace_down(points)
        return np.where(is_hit, surface, np.asarray(points)[:, 2])

    def lies_under(self, points: np.ndarray) -> np.ndarray:
        """Whether `height` finds a surface, (n,) bool."""
        return self._trace_down(points)[1]

    def _trace_down(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        start = np.asarray(points, np.float32) + np.array([0, 0, _ABOVE_M], np.float32)
        down = np.tile(np.array([[0, 0, -1]], np.float32), (len(start), 1))
        distance, triangle = self._bvh.first_hit(start, down, np.full(len(start), _BELOW_M, np.float32))
        return start[:, 2].astype(np.float64) - distance, triangle >= 0
