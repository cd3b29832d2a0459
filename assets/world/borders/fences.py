"""Plot borders a few metres at a time: pickets, wire, railings, walls and hedges."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box, cylinder
from assets.world.instancing import instances
from assets.world.plants.trees import hedge

PIECE_M = {
    "picket": 2.0,
    "wire": 4.0,
    "railing": 2.0,
    "wall_brick": 6.0,
    "wall_stone": 6.0,
    "wall_plaster": 6.0,
    "hedge": 4.0,
}
FENCE_KINDS = tuple(PIECE_M)
TALL_KINDS = ("wall_brick", "wall_plaster", "hedge")  # hide what is behind
OPEN_KINDS = ("wire", "hedge", "hedge")  # between neighbours


def fence_piece(kind: str, rng: np.random.Generator) -> Mesh:
    """A piece along x from 0 to `PIECE_M[kind]`, standing on z = 0.

    Raises:
        ValueError: no such kind.
    """
    if kind == "picket":
        return _pickets(PIECE_M[kind])
    if kind == "wire":
        return _wire(PIECE_M[kind])
    if kind == "railing":
        return _railing(PIECE_M[kind])
    if kind == "wall_brick":
        return _wall(PIECE_M[kind], 1.4, "brick", "concrete")
    if kind == "wall_stone":
        return _wall(PIECE_M[kind], 0.75, "stone", "stone")
    if kind == "wall_plaster":
        return _wall(PIECE_M[kind], 1.7, "plaster_white", "roof_tile")
    if kind == "hedge":
        return hedge(rng, PIECE_M[kind], 0.7, 1.8)
    raise ValueError(f"fence kind {kind!r} is unknown; use one of {', '.join(FENCE_KINDS)}")


def line_of(
    start: np.ndarray, end: np.ndarray, z_start: np.ndarray, z_end: np.ndarray, piece_m: np.ndarray,
    rise: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Poses (n, 4, 4) of pieces from `start` to `end` (n, 2), stretched from `piece_m` (n,), sheared, `rise` high."""
    run = end - start
    length = np.linalg.norm(run, axis=1)
    pose = np.zeros((len(start), 4, 4))
    pose[:, :2, 0] = run / piece_m[:, None]
    pose[:, :2, 1] = run[:, ::-1] * [-1.0, 1.0] / length[:, None]
    pose[:, 2, 0] = (z_end - z_start) / piece_m
    pose[:, 2, 2], pose[:, 3, 3] = rise, 1.0
    pose[:, :2, 3], pose[:, 2, 3] = start, z_start
    return pose


def fences_mesh(kind: np.ndarray, poses: np.ndarray, rng: np.random.Generator) -> Mesh:
    """All borders: the kind (n,) and pose (n, 4, 4) of every piece."""
    return Mesh.merge([instances(fence_piece(name, rng), poses[kind == name]) for name in FENCE_KINDS])


def _pickets(length_m: float) -> Mesh:
    boards = [_board(0.125 + 0.25 * k, 0.11, 0.08, 1.0 + 0.04 * (k % 2), 0.03) for k in range(8)]
    rails = [_board(length_m / 2, length_m, z, z + 0.07, 0.0) for z in (0.28, 0.76)]
    return Mesh.merge([*boards, *rails, cylinder(0.05, 1.05, "wood", 4).moved((0, -0.05, 0))])


def _board(x: float, width_m: float, bottom_m: float, top_m: float, y: float) -> Mesh:
    """A thin upright board: one sheet, seen from both sides."""
    half = width_m / 2
    corners = np.array([[x - half, y, bottom_m], [x + half, y, bottom_m], [x + half, y, top_m], [x - half, y, top_m]])
    return Mesh.of(corners, np.array([[0, 2, 1], [0, 3, 2]]), "wood")


def _strip(start: tuple[float, float, float], end: tuple[float, float, float], width_m: float, metal: str) -> Mesh:
    """A thin bar in the plane of the fence: one sheet, seen from both sides."""
    root, tip = np.array(start), np.array(end)
    along = (tip - root) / np.linalg.norm(tip - root)
    side = np.array([-along[2], 0.0, along[0]]) * width_m / 2
    return Mesh.of(
        np.stack([root - side, tip - side, tip + side, root + side]), np.array([[0, 1, 2], [0, 2, 3]]), metal
    )


def _rod(start: tuple[float, float, float], end: tuple[float, float, float], radius_m: float, metal: str) -> Mesh:
    """A bar of triangular section with open ends: six triangles."""
    root, tip = np.array(start), np.array(end)
    axis = (tip - root) / np.linalg.norm(tip - root)
    u = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    u /= np.linalg.norm(u)
    angle = 2 * np.pi * np.arange(3)[:, None] / 3
    ring = radius_m * (np.cos(angle) * u + np.sin(angle) * np.cross(axis, u))
    faces = [[k, m, m + 3] for k, m in ((0, 1), (1, 2), (2, 0))] + [
        [k, m + 3, k + 3] for k, m in ((0, 1), (1, 2), (2, 0))
    ]
    return Mesh.of(np.vstack([ring + root, ring + tip]), np.array(faces), metal)


def _wire(length_m: float) -> Mesh:
    wires = [_strip((0, 0, z), (length_m, 0, z), 0.016, "steel_galvanised") for z in (0.2, 0.7, 1.2)]
    return Mesh.merge([_rod((0, 0, -0.2), (0, 0, 1.25), 0.035, "steel_galvanised"), *wires])


def _railing(length_m: float) -> Mesh:
    rails = [_strip((0, 0, z), (length_m, 0, z), 0.05, "steel_painted") for z in (0.2, 1.7)]
    bars = [_strip((0.25 * k, 0, 0.2), (0.25 * k, 0, 1.75), 0.028, "steel_painted") for k in range(1, 8)]
    return Mesh.merge([_rod((0, 0, -0.2), (0, 0, 1.9), 0.05, "steel_painted"), *rails, *bars])


def _wall(length_m: float, height_m: float, body: str, coping: str) -> Mesh:
    wall = box((length_m, 0.22, height_m + 0.3), (length_m / 2, 0, height_m / 2 - 0.15), body)
    return Mesh.merge([wall, box((length_m, 0.30, 0.06), (length_m / 2, 0, height_m + 0.03), coping)])
