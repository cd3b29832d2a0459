"""Thin sheets draped over the smooth surface: ribbons and discs a few millimetres above the road."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from assets.mesh import Mesh

Heights = Callable[[np.ndarray], np.ndarray]
_PIECE_M = 2.1  # a sheet longer than this is cut so that it follows the surface


def ribbons(start: np.ndarray, end: np.ndarray, width_m: np.ndarray | float, z: Heights, material: str) -> Mesh:
    """Straight bands from `start` to `end` (n, 2), facing up, at heights `z` of their corners."""
    length = np.linalg.norm(end - start, axis=1)
    keep = length > 0.02
    start, end, length = start[keep], end[keep], length[keep]
    width = np.broadcast_to(np.asarray(width_m, np.float64), len(keep))[keep]
    if len(start) == 0:
        return Mesh.empty()
    count = np.maximum(1, np.ceil(length / _PIECE_M)).astype(int)
    which = np.repeat(np.arange(len(start)), count)
    part = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    step = ((end - start) / count[:, None])[which]
    first = start[which] + step * part[:, None]
    side = ((end - start) / length[:, None])[which][:, ::-1] * [-1.0, 1.0] * (width[which] / 2)[:, None]
    corners = np.stack([first - side, first + step - side, first + step + side, first + side], axis=1)
    xy = corners.reshape(-1, 2)
    quads = np.arange(len(xy)).reshape(-1, 4)
    return Mesh.of(np.column_stack([xy, z(xy)]), quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), material)


def discs(centre: np.ndarray, radius_m: float, z: Heights, material: str, corners: int = 12) -> Mesh:
    """Flat round lids at `centre` (n, 2), facing up."""
    angle = 2 * np.pi * np.arange(corners) / corners
    rim = radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    xy = np.concatenate([centre[:, None], centre[:, None] + rim], axis=1).reshape(-1, 2)
    k = np.arange(corners)
    fan = np.stack([np.zeros(corners, int), 1 + k, 1 + (k + 1) % corners], axis=1)
    faces = (fan[None] + (corners + 1) * np.arange(len(centre))[:, None, None]).reshape(-1, 3)
    return Mesh.of(np.column_stack([xy, z(xy)]), faces, material)
