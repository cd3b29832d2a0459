"""Roofs of a rectangular house as unit shapes, stretched to each house by an affine matrix."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box, clean

_THICKNESS = 0.06  # of the unit height


def gable(tiles: str, wall: str, verge: float, eaves: float) -> Mesh:
    """Two slopes over [−1, 1]² with the ridge along x at height 1; gable walls included.

    Args:
        tiles, wall: materials.
        verge, eaves: how far the roof reaches beyond the walls along and across the ridge, as a share.
    """
    over_x, over_y = 1.0 + verge, 1.0 + eaves
    eave = 1.0 - over_y
    roof = np.array([[s * over_x, y, z] for s in (-1, 1) for y, z in ((-over_y, eave), (0, 1), (over_y, eave))])
    slopes = [[0, 3, 4, 1], [1, 4, 5, 2]]
    walls = np.array([[-1, -1, 0], [-1, 1, 0], [-1, 0, 1], [1, -1, 0], [1, 1, 0], [1, 0, 1]], float)
    sides = Mesh.of(walls, np.array([[0, 2, 1], [3, 4, 5]]), wall)
    return Mesh.merge([_slab(roof, slopes, tiles), sides])


def hip(tiles: str, ridge: float) -> Mesh:
    """Four slopes over [−1, 1]² with a ridge from x = −`ridge` to `ridge` at height 1."""
    over = 1.06
    eave = 1.0 - over
    roof = np.array(
        [
            [-over, -over, eave], [over, -over, eave], [over, over, eave], [-over, over, eave],
            [-ridge, 0, 1], [ridge, 0, 1],
        ]
    )  # fmt: skip
    return _slab(roof, [[0, 1, 5, 4], [2, 3, 4, 5], [1, 2, 5], [3, 0, 4]], tiles)


def flat(cover: str, wall: str) -> Mesh:
    """A deck at height 0 inside a parapet that reaches height 1."""
    deck = Mesh.of(
        np.array([[-0.97, -0.97, 0.05], [0.97, -0.97, 0.05], [0.97, 0.97, 0.05], [-0.97, 0.97, 0.05]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
        cover,
    )
    sides = [box((2.0, 0.05, 1.0), (0, s * 0.975, 0.5), wall) for s in (-1, 1)] + [
        box((0.05, 1.92, 1.0), (s * 0.975, 0, 0.5), wall) for s in (-1, 1)
    ]
    return Mesh.merge([deck, *sides])


def _slab(points: np.ndarray, polygons: list[list[int]], material: str) -> Mesh:
    """Upper faces, the same faces underneath, and the edge between them."""
    n = len(points)
    lower = points - [0.0, 0.0, _THICKNESS]
    faces = [[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)]
    under = [[f[0] + n, f[2] + n, f[1] + n] for f in faces]
    edges = [(p[k], p[(k + 1) % len(p)]) for p in polygons for k in range(len(p))]
    rim = [(a, b) for a, b in edges if (b, a) not in edges]
    band = [t for a, b in rim for t in ([a + n, b + n, b], [a + n, b, a])]
    return clean(Mesh.of(np.concatenate([points, lower]), np.array(faces + under + band), material))
