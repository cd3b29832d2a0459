"""Puts many copies of a template into the world in one array operation."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh


def instances(template: Mesh, poses: np.ndarray) -> Mesh:
    """Copies of `template` under affine poses (k, 4, 4) that do not mirror."""
    count, n = len(poses), len(template.vertices)
    if count == 0 or n == 0:
        return Mesh.empty()
    vertices = np.einsum("kij,nj->kni", poses[:, :3, :3], template.vertices.astype(np.float64))
    vertices += poses[:, None, :3, 3]
    faces = template.faces[None].astype(np.int64) + (np.arange(count) * n)[:, None, None]
    return Mesh(vertices.reshape(-1, 3), faces.reshape(-1, 3), np.tile(template.materials, count))


def poses(xyz: np.ndarray, yaw_rad: np.ndarray | float = 0.0, scale: np.ndarray | float = 1.0) -> np.ndarray:
    """Affine matrices (k, 4, 4): scale, turn about z by `yaw_rad`, move to `xyz` (k, 3).

    `scale` is one number, one a copy (k,), or one an axis and copy (k, 3).
    """
    count = len(xyz)
    yaw = np.broadcast_to(np.asarray(yaw_rad, np.float64), count)
    factor = np.asarray(scale, np.float64)
    factor = np.broadcast_to(factor[:, None] if factor.ndim == 1 else factor, (count, 3))
    matrix = np.zeros((count, 4, 4))
    cosine, sine = np.cos(yaw), np.sin(yaw)
    matrix[:, 0, 0], matrix[:, 0, 1] = cosine, -sine
    matrix[:, 1, 0], matrix[:, 1, 1] = sine, cosine
    matrix[:, 2, 2] = 1.0
    matrix[:, :3, :3] *= factor[:, None, :]
    matrix[:, :3, 3] = xyz
    matrix[:, 3, 3] = 1.0
    return matrix
