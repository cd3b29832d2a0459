"""Skin of a left half of a body: a grid of points, with a material a cell, mirrored into a whole.

A *column* is a cross-section; columns run from the nose along the left side to the tail. A *row* runs
lengthwise; rows climb from the centre line below, out to the flank and back to the centre line above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.materials import material_index
from assets.mesh import Mesh
from assets.shapes import clean, flipped, grid_faces, mirrored, weld


@dataclass(frozen=True)
class HalfShell:
    """Grid of the left half of a skin.

    Attributes:
        points: (c, r, 3) metres, y ≥ 0.
        materials: (c − 1, r − 1) uint8 material rows, one a cell.
    """

    points: np.ndarray
    materials: np.ndarray

    def half(self, cells: np.ndarray | None = None) -> Mesh:
        """Mesh of the left half, or of the cells where the mask (c − 1, r − 1) is true."""
        faces = grid_faces(self.points.shape[0], self.points.shape[1])
        mesh = Mesh(self.points.reshape(-1, 3), faces, np.repeat(self.materials.reshape(-1), 2))
        return clean(mesh if cells is None else mesh.select(np.repeat(cells.reshape(-1), 2)), 1e-6)

    def whole(self) -> Mesh:
        """Both halves, joined along the centre line."""
        return both_sides(self.half())

    def half_lining(self, cells: np.ndarray, depth_m: float, material: str) -> Mesh:
        """Inner skin of the left half: masked cells moved inward by `depth_m` and facing inward."""
        along = np.gradient(self.points, axis=0)
        across = np.gradient(self.points, axis=1)
        normal = np.cross(along, across)
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
        normal[:, -1, 1] = 0.0  # the centre line stays in its plane
        inner = HalfShell(self.points - depth_m * normal, np.full_like(self.materials, material_index(material)))
        return flipped(inner.half(cells))

    def lining(self, cells: np.ndarray, depth_m: float, material: str) -> Mesh:
        """Inner skin of both halves."""
        return both_sides(self.half_lining(cells, depth_m, material))


def both_sides(half: Mesh) -> Mesh:
    """A left half and its mirror image as one welded mesh."""
    return weld(Mesh.merge([half, mirrored(half)]))
