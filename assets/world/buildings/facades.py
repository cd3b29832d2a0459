"""Walls cut into rectangular cells; a cell may hold a window or a door recessed in a real opening."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.materials import material_index
from assets.mesh import Mesh

BLANK, WINDOW, DOOR = 0, 1, 2
_RECESS_M = 0.10  # pane behind the wall's face
_FRAME_M = 0.06  # frame width seen from outside
_MULLION_M = 0.07
_WIDE_PANE_M = 0.95  # wider panes get an upright in the middle


@dataclass(frozen=True, eq=False)
class Cells:
    """Rectangles of wall, seen from outside: `right` to the right, z up.

    Attributes:
        corner: (n, 3) lower left corner, world metres.
        right: (n, 2) horizontal unit vector; the outside is to its right-hand side (clockwise).
        size: (n, 2) width and height.
        opening: (n, 4) left, bottom, right, top of the opening from the corner; ignored where blank.
        kind: (n,) BLANK, WINDOW or DOOR.
        material: (n,) material row of the wall.
        leaf: (n,) material row of the door leaf.
    """

    corner: np.ndarray
    right: np.ndarray
    size: np.ndarray
    opening: np.ndarray
    kind: np.ndarray
    material: np.ndarray
    leaf: np.ndarray

    @classmethod
    def merge(cls, parts: list[Cells]) -> Cells:
        """All cells of several sets."""
        names = ("corner", "right", "size", "opening", "kind", "material", "leaf")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def where(self, mask: np.ndarray) -> Cells:
        """The cells selected by a mask (n,)."""
        names = ("corner", "right", "size", "opening", "kind", "material", "leaf")
        return Cells(*(getattr(self, name)[mask] for name in names))

    def points(self, x: np.ndarray, y: np.ndarray, depth_m: float = 0.0) -> np.ndarray:
        """World points (n, 3) at `x`, `y` (n,) from the corner, `depth_m` behind the wall's face."""
        inward = np.stack([-self.right[:, 1], self.right[:, 0]], axis=1)
        flat = self.corner[:, :2] + self.right * x[:, None] + inward * depth_m
        return np.column_stack([flat, self.corner[:, 2] + y])


def facade_mesh(cells: Cells) -> Mesh:
    """Walls with their windows and doors."""
    blank, open_ = cells.where(cells.kind == BLANK), cells.where(cells.kind != BLANK)
    zero = np.zeros(len(blank.kind))
    whole = _rectangle(blank, zero, zero, blank.size[:, 0], blank.size[:, 1])
    parts = [_quads(whole, blank.material)]
    zero = np.zeros(len(open_.kind))
    outer = _rectangle(open_, zero, zero, open_.size[:, 0], open_.size[:, 1])
    left, bottom, right, top = open_.opening.T
    hole = _rectangle(open_, left, bottom, right, top)
    sill = np.where(open_.kind == DOOR, 0.0, _FRAME_M)
    inner = (left + _FRAME_M, bottom + sill, right - _FRAME_M, top - _FRAME_M)
    pane = _rectangle(open_, inner[0], inner[1], inner[2], inner[3], _RECESS_M)
    frame = np.full(len(open_.kind), material_index("window_frame"))
    leaf = np.where(open_.kind == DOOR, open_.leaf, material_index("window_glass"))
    for k in range(4):
        m = (k + 1) % 4
        parts.append(_quads([outer[k], outer[m], hole[m], hole[k]], open_.material))
        parts.append(_quads([hole[k], hole[m], pane[m], pane[k]], frame))
    parts.append(_quads(pane, leaf))
    parts.append(_mullions(open_, inner))
    return Mesh.merge(parts)


def _mullions(cells: Cells, sides: tuple[np.ndarray, ...]) -> Mesh:
    """An upright bar before the middle of wide panes."""
    left, bottom, right, top = sides
    wide = (cells.kind == WINDOW) & (right - left > _WIDE_PANE_M)
    middle = ((left + right) / 2)[wide]
    subset = cells.where(wide)
    bar = _rectangle(
        subset, middle - _MULLION_M / 2, bottom[wide], middle + _MULLION_M / 2, top[wide], _RECESS_M - 0.03
    )
    return _quads(bar, np.full(len(middle), material_index("window_frame")))


def _rectangle(
    cells: Cells, left: np.ndarray, bottom: np.ndarray, right: np.ndarray, top: np.ndarray, depth_m: float = 0.0
) -> list[np.ndarray]:
    """Corners, counter-clockwise seen from outside, each (n, 3)."""
    sides = ((left, bottom), (right, bottom), (right, top), (left, top))
    return [cells.points(x, y, depth_m) for x, y in sides]


def _quads(corners: list[np.ndarray], materials: np.ndarray) -> Mesh:
    """Two triangles for each row of four corners, each (n, 3); those without area are left out."""
    n = len(materials)
    index = np.arange(n)
    faces = np.concatenate(
        [np.stack([index, index + n, index + 2 * n], 1), np.stack([index, index + 2 * n, index + 3 * n], 1)]
    )
    vertices = np.concatenate(corners)
    p, q, r = (vertices[faces[:, k]] for k in range(3))
    solid = np.linalg.norm(np.cross(q - p, r - p), axis=1) > 1e-6
    return Mesh(vertices, faces[solid], np.tile(materials, 2)[solid])
