"""The static world cut into square tiles, of which only those in view are prepared and drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.cache import cached_latest
from assets.mesh import Mesh
from sensors.cameras.baking import vertex_normals
from sensors.cameras.closed import closed_faces
from sensors.cameras.packing import drawable
from sensors.cameras.projection import boxes_inside

_TILE_M = 24.0


@dataclass(frozen=True, eq=False)
class Tiles:
    """A static world whose faces lie sorted by tile: squares of the ground plan, closed surfaces apart from the rest.

    Attributes:
        mesh: the drawable faces, sorted; vertices are those of the whole world.
        first: (t,) int64 first face of each tile.
        count: (t,) int64 number of faces.
        bounds: (t, 2, 3) float64 corners of each box, world axes [m].
        closed: (t,) bool, all faces belong to closed surfaces.
        vertex_normals: (n, 3) float32 of the whole world, glass included.
    """

    mesh: Mesh
    first: np.ndarray
    count: np.ndarray
    bounds: np.ndarray
    closed: np.ndarray
    vertex_normals: np.ndarray

    @classmethod
    def of(cls, static: Mesh) -> Tiles:
        """Cut a world, in world axes, into tiles of 24 m."""
        normals = vertex_normals(static)  # first: it needs the most memory, and the rest does not exist yet
        mesh = drawable(static)
        closed = closed_faces(mesh)
        order, tile = sort_into_tiles(mesh, closed, _TILE_M)
        mesh, closed = Mesh(mesh.vertices, mesh.faces[order], mesh.materials[order]), closed[order]
        first = np.flatnonzero(np.diff(tile, prepend=-1))
        count = np.diff(np.append(first, len(tile)))
        bounds = np.zeros((len(first), 2, 3))
        if len(first):
            triangles = mesh.triangles
            bounds[:, 0] = np.minimum.reduceat(triangles.min(1), first)
            bounds[:, 1] = np.maximum.reduceat(triangles.max(1), first)
        return cls(mesh, first, count, bounds, closed[first], normals)

    def in_view(self, planes: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) of the tiles inside the frustum `planes` (6, 4), nearest first, and distances from `eye` [m]."""
        rows = np.flatnonzero(boxes_inside(planes, self.bounds))
        nearest = np.clip(eye, self.bounds[rows, 0], self.bounds[rows, 1])
        distance = np.linalg.norm(nearest - eye, axis=1)
        order = np.argsort(distance, kind="stable")
        return rows[order], distance[order]

    def faces_of(self, rows: np.ndarray) -> np.ndarray:
        """Rows of `mesh` of all faces of some tiles (k,), tile after tile."""
        count = self.count[rows]
        start = np.repeat(self.first[rows] - (np.cumsum(count) - count), count)
        return start + np.arange(len(start))


def cut_world(static: Mesh) -> Tiles:
    """`Tiles.of` a world; shares its vertices. Those of the worlds used last are kept on disk, 20 MB each."""
    faces, materials, *rest = _cut(static)
    return Tiles(Mesh(static.vertices, faces, materials), *rest)


@cached_latest(8)
def _cut(static: Mesh) -> tuple[np.ndarray, ...]:
    """Faces and materials of `Tiles.of` a world, and its other attributes."""
    tiles = Tiles.of(static)
    mesh = tiles.mesh
    return mesh.faces, mesh.materials, tiles.first, tiles.count, tiles.bounds, tiles.closed, tiles.vertex_normals


def sort_into_tiles(mesh: Mesh, closed: np.ndarray, side_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Order of faces (m,) that puts those of a tile together, and each sorted face's tile number (m,).

    A tile is a square of the ground plan; its closed faces (`closed`, (m,) bool) and the others make two.
    """
    if not len(mesh.faces):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    cell = np.floor(mesh.triangles[:, :, :2].mean(1) / side_m).astype(np.int64)
    cell -= cell.min(0)
    key = (cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]) * 2 + closed
    order = np.argsort(key, kind="stable")
    return order, np.cumsum(np.diff(key[order], prepend=key[order[0]]) != 0)
