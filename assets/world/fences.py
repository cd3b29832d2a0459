"""Plot borders two metres at a time: pickets, wire, railings, walls and hedges."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box, cylinder
from assets.world.instancing import instances
from assets.world.trees import hedge

PIECE_M = 2.0
FENCE_KINDS = ("picket", "wire", "railing", "wall_brick", "wall_stone", "wall_plaster", "hedge")


def fence_piece(kind: str, rng: np.random.Generator) -> Mesh:
    """A piece along x from 0 to 2 m, standing on z = 0.

    Raises:
        ValueError: no such kind.
    """
    if kind == "picket":
        return _pickets()
    if kind == "wire":
        return _wire()
    if kind == "railing":
        return _railing()
    if kind == "wall_brick":
        return _wall(1.0, "brick", "concrete")
    if kind == "wall_stone":
        return _wall(0.75, "stone", "stone")
    if kind == "wall_plaster":
        return _wall(1.5, "plaster_white", "roof_tile")
    if kind == "hedge":
        return hedge(rng, PIECE_M, 0.7, 1.3)
    raise ValueError(f"fence kind {kind!r} is unknown; use one of {', '.join(FENCE_KINDS)}")


def line_of(start: np.ndarray, end: np.ndarray, z_start: np.ndarray, z_end: np.ndarray) -> np.ndarray:
    """Poses (n, 4, 4) that stretch a piece from `start` to `end` (n, 2) and shear it along the slope."""
    run = end - start
    length = np.linalg.norm(run, axis=1)
    pose = np.zeros((len(start), 4, 4))
    pose[:, :2, 0] = run / PIECE_M
    pose[:, :2, 1] = run[:, ::-1] * [-1.0, 1.0] / length[:, None]
    pose[:, 2, 0] = (z_end - z_start) / PIECE_M
    pose[:, 2, 2] = pose[:, 3, 3] = 1.0
    pose[:, :2, 3], pose[:, 2, 3] = start, z_start
    return pose


def fences_mesh(pieces: dict[str, list[np.ndarray]], rng: np.random.Generator) -> Mesh:
    """All borders: for each kind the poses (n, 4, 4) of its pieces."""
    kinds = [kind for kind in FENCE_KINDS if pieces.get(kind)]
    return Mesh.merge([instances(fence_piece(kind, rng), np.concatenate(pieces[kind])) for kind in kinds])


def _pickets() -> Mesh:
    boards = [_board(0.1 + 0.2 * k, 0.09, 0.08, 1.0 + 0.04 * (k % 2), 0.03) for k in range(10)]
    rails = [box((PIECE_M, 0.04, 0.07), (PIECE_M / 2, -0.035, z), "wood") for z in (0.3, 0.8)]
    return Mesh.merge([*boards, *rails, box((0.09, 0.09, 1.05), (0.0, -0.08, 0.5), "wood")])


def _board(x: float, width_m: float, bottom_m: float, top_m: float, y: float) -> Mesh:
    """A thin board seen from both sides: four triangles."""
    half = width_m / 2
    corners = np.array([[x - half, y, bottom_m], [x + half, y, bottom_m], [x + half, y, top_m], [x - half, y, top_m]])
    back = corners - [0, 0.02, 0]
    return Mesh.of(np.vstack([corners, back]), np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]), "wood")


def _wire() -> Mesh:
    post = cylinder(0.03, 1.25, "steel_galvanised", segments=5)
    wires = [box((PIECE_M, 0.012, 0.012), (PIECE_M / 2, 0, z), "steel_galvanised") for z in (0.15, 0.5, 0.85, 1.2)]
    return Mesh.merge([post, *wires])


def _railing() -> Mesh:
    post = box((0.07, 0.07, 1.9), (0.0, 0, 0.9), "steel_painted")
    rails = [box((PIECE_M, 0.04, 0.04), (PIECE_M / 2, 0, z), "steel_painted") for z in (0.2, 1.7)]
    bars = [_bar(0.2 * k, 0.02) for k in range(1, 10)]
    return Mesh.merge([post, *rails, *bars])


def _bar(x: float, width_m: float) -> Mesh:
    """An upright of triangular section: six triangles."""
    return cylinder(width_m * 0.6, 1.55, "steel_painted", segments=3).moved((x, 0, 0.2))


def _wall(height_m: float, body: str, coping: str) -> Mesh:
    wall = box((PIECE_M, 0.22, height_m + 0.3), (PIECE_M / 2, 0, height_m / 2 - 0.15), body)
    return Mesh.merge([wall, box((PIECE_M, 0.30, 0.06), (PIECE_M / 2, 0, height_m + 0.03), coping)])
