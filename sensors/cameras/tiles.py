"""The static world cut into square tiles, so that only those in view are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.mesh import Mesh
from sensors.cameras.projection import boxes_inside


@dataclass(frozen=True, eq=False)
class Tiles:
    """Runs of consecutive faces and their boxes.

    Attributes:
        first: (t,) int64 first face of each tile.
        count: (t,) int64 number of faces.
        bounds: (t, 2, 3) float64 corners of each box, world axes [m].
        closed: (t,) bool, all faces belong to closed surfaces.
    """

    first: np.ndarray
    count: np.ndarray
    bounds: np.ndarray
    closed: np.ndarray

    def in_view(self, planes: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) of the tiles inside the frustum `planes` (6, 4), nearest first, and distances from `eye` [m]."""
        rows = np.flatnonzero(boxes_inside(planes, self.bounds))
        nearest = np.clip(eye, self.bounds[rows, 0], self.bounds[rows, 1])
        distance = np.linalg.norm(nearest - eye, axis=1)
        order = np.argsort(distance, kind="stable")
        return rows[order], distance[order]


def sort_into_tiles(mesh: Mesh, closed: np.ndarray, side_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Order of faces (m,) that puts those of a tile together, and each sorted face's tile number (m,).

    A tile is a square of the ground plan; its closed faces (`closed`, (m,) bool) and the others make two.
    """
    cell = np.floor(mesh.triangles[:, :, :2].mean(1) / side_m).astype(np.int64)
    _, tile = np.unique(np.column_stack([cell, closed]), axis=0, return_inverse=True)
    order = np.argsort(tile.ravel(), kind="stable")
    return order, tile.ravel()[order]


def tiles_of(positions: np.ndarray, faces: np.ndarray, tile: np.ndarray, closed: np.ndarray) -> Tiles:
    """Tiles of faces (m, 3) already sorted by their tile number (m,)."""
    first = np.flatnonzero(np.diff(tile, prepend=-1))
    count = np.diff(np.append(first, len(tile)))
    if not len(first):
        return Tiles(first, count, np.zeros((0, 2, 3)), closed)
    triangles = positions[faces]
    low = np.minimum.reduceat(triangles.min(1), first)
    high = np.maximum.reduceat(triangles.max(1), first)
    return Tiles(first, count, np.stack([low, high], 1).astype(np.float64), closed[first])
