"""Thin sheets draped over the ground: ribbons and discs a few millimetres above the road."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from assets.mesh import Mesh

Heights = Callable[[np.ndarray], np.ndarray]
_PIECE_M = 0.9  # a sheet longer or wider than this is cut so that it follows the ground


def ribbons(
    start: np.ndarray,
    end: np.ndarray,
    width_m: np.ndarray | float,
    z: Heights,
    material: str,
    piece_m: float = _PIECE_M,
) -> Mesh:
    """Straight bands from `start` to `end` (n, 2), facing up, at heights `z` of their corners and nowhere below it."""
    length = np.linalg.norm(end - start, axis=1)
    keep = length > 0.02
    start, end, length = start[keep], end[keep], length[keep]
    width = np.broadcast_to(np.asarray(width_m, np.float64), len(keep))[keep]
    if len(start) == 0:
        return Mesh.empty()
    along, across = (np.maximum(1, np.ceil(span / piece_m)).astype(int) for span in (length, width))
    count = along * across
    which = np.repeat(np.arange(len(start)), count)
    part = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    run = ((end - start) / along[:, None])[which]
    left = ((end - start) / length[:, None])[:, ::-1] * [-1.0, 1.0] * width[:, None]
    rise = (left / across[:, None])[which]
    first = (start - left / 2)[which] + run * (part // across[which])[:, None] + rise * (part % across[which])[:, None]
    corners = np.stack([first, first + run, first + run + rise, first + rise], axis=1)
    heights = z(corners.reshape(-1, 2)).reshape(-1, 4)
    between = (corners + np.roll(corners, -1, axis=1)) / 2
    chords = (heights + np.roll(heights, -1, axis=1)) / 2
    sunk = (z(between.reshape(-1, 2)).reshape(-1, 4) - chords).max(1)  # under a ridge between two corners
    _, corner = np.unique(np.round(corners.reshape(-1, 2), 4), axis=0, return_inverse=True)
    lift = np.zeros(corner.max() + 1)
    np.maximum.at(lift, corner.reshape(-1, 4), np.maximum(sunk, 0.0)[:, None])  # pieces stay joined
    heights += lift[corner.reshape(-1, 4)]
    quads = np.arange(4 * len(corners)).reshape(-1, 4)
    vertices = np.column_stack([corners.reshape(-1, 2), heights.reshape(-1)])
    return Mesh.of(vertices, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), material)


def discs(centre: np.ndarray, radius_m: float, z: Heights, material: str, corners: int = 12) -> Mesh:
    """Flat round lids at `centre` (n, 2), facing up."""
    angle = 2 * np.pi * np.arange(corners) / corners
    rim = radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    xy = np.concatenate([centre[:, None], centre[:, None] + rim], axis=1).reshape(-1, 2)
    k = np.arange(corners)
    fan = np.stack([np.zeros(corners, int), 1 + k, 1 + (k + 1) % corners], axis=1)
    faces = (fan[None] + (corners + 1) * np.arange(len(centre))[:, None, None]).reshape(-1, 3)
    return Mesh.of(np.column_stack([xy, z(xy)]), faces, material)
