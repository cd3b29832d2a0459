"""The static world in graphics memory, prepared and drawn tile by tile. Imports OpenGL."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from sensors.cameras.baking import Shade
from sensors.cameras.buffers import GrowingBuffer, back_faces
from sensors.cameras.packing import pack
from sensors.cameras.tiles import Tiles


class StaticWorld:
    """A buffer of the tiles seen so far, because a single drive sees only a small part of a town.

    Args:
        tiles: of the world.
        shade: gives the share of sun and of sky at rows of the world's vertices; None for none in shadow.
    """

    def __init__(self, tiles: Tiles, shade: Shade | None) -> None:
        self.tiles = tiles
        self._shade = shade
        self._first = np.full(len(tiles.first), -1, np.int64)  # in the buffer
        self._buffer = GrowingBuffer()

    def draw(self, rows: np.ndarray) -> None:
        """Draw some tiles (k,) in the order given, closed surfaces first; the program must be in use."""
        new = rows[self._first[rows] < 0]
        if len(new):
            self._make_ready(new)
        for closed in (True, False):
            chosen = rows[self.tiles.closed[rows] == closed]
            with back_faces(drawn=not closed):
                self._buffer.draw_runs(self._first[chosen], self.tiles.count[chosen])

    def close(self) -> None:
        """Free the graphics memory."""
        self._buffer.close()

    def _make_ready(self, rows: np.ndarray) -> None:
        mesh, faces, count = self.tiles.mesh, self.tiles.faces_of(rows), self.tiles.count[rows]
        # Tiles share no vertices, so that each is packed in the same way whichever others are prepared with it.
        own = np.repeat(np.arange(len(rows)), count)[:, None] * len(mesh.vertices) + mesh.faces[faces]
        used, corners = np.unique(own, return_inverse=True)
        used %= len(mesh.vertices)
        shade = None if self._shade is None else self._shade(used)
        packed = pack(Mesh(mesh.vertices[used], corners.reshape(-1, 3), mesh.materials[faces]), shade)
        self._first[rows] = self._buffer.add(packed) + np.cumsum(count) - count
