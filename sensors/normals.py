"""Unit vectors in two 12-bit numbers: the octahedral encoding (Meyer et al., EGSR 2010)."""

from __future__ import annotations

import numpy as np

_STEPS = 2047


def encode_normals(normals: np.ndarray) -> np.ndarray:
    """Octahedral codes, (n, 2) int16, of unit vectors (n, 3); within 0.05° of the original."""
    normals = np.asarray(normals, np.float32)
    size = np.abs(normals).sum(1)
    x, y = (normals[:, :2] / np.where(size > 0, size, 1)[:, None]).T
    below = normals[:, 2] < 0
    folded_x = np.where(below, (1 - np.abs(y)) * np.where(x >= 0, 1, -1), x)
    folded_y = np.where(below, (1 - np.abs(x)) * np.where(y >= 0, 1, -1), y)
    return np.rint(np.stack([folded_x, folded_y], 1) * _STEPS).astype(np.int16)


def decode_normals(codes: np.ndarray) -> np.ndarray:
    """Unit vectors, (n, 3) float32, of octahedral codes (n, 2)."""
    normals = np.stack(_unfolded(codes), 1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def dot_with_normals(codes: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Scalar products, (n,) float32, of the unit vectors of codes (n, 2) with `vectors` (n, 3) float32."""
    x, y, z = _unfolded(codes)
    dot = x * vectors[:, 0] + y * vectors[:, 1] + z * vectors[:, 2]
    return dot / np.sqrt(x * x + y * y + z * z)


def _unfolded(codes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points on the octahedron |x| + |y| + |z| = 1, each coordinate (n,) float32."""
    scale = np.float32(1 / _STEPS)
    x, y = codes[:, 0] * scale, codes[:, 1] * scale
    z = 1 - np.abs(x) - np.abs(y)
    fold = np.maximum(-z, 0)
    return x - np.copysign(fold, x), y - np.copysign(fold, y), z
