"""The static world in graphics memory, drawn tile by tile. Imports OpenGL."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from sensors.cameras.buffers import MeshBuffer, back_faces
from sensors.cameras.closed import closed_faces
from sensors.cameras.packing import drawable, pack
from sensors.cameras.tiles import sort_into_tiles, tiles_of

_TILE_M = 24.0


class StaticWorld:
    """One buffer holding two sets of tiles: closed surfaces, whose backs are left out, and the rest.

    Args:
        static: world axes.
        shade: (n, 2) share of sun and sky per vertex of `static`, or None.
    """

    def __init__(self, static: Mesh, shade: np.ndarray | None) -> None:
        mesh = drawable(static)
        closed = closed_faces(mesh)
        order, tile = sort_into_tiles(mesh, closed, _TILE_M)
        packed = pack(Mesh(mesh.vertices, mesh.faces[order], mesh.materials[order]), shade)
        self.tiles = tiles_of(packed.vertices["position"], packed.faces, tile, closed[order])
        self._buffer = MeshBuffer(packed)

    def draw(self, rows: np.ndarray) -> None:
        """Draw some tiles (k,) in the order given, closed surfaces first; the program must be in use."""
        for closed in (True, False):
            chosen = rows[self.tiles.closed[rows] == closed]
            with back_faces(drawn=not closed):
                self._buffer.draw_runs(self.tiles.first[chosen], self.tiles.count[chosen])
