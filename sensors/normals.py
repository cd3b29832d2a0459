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
    x, y = (np.asarray(codes, np.float32) / np.float32(_STEPS)).T
    z = 1 - np.abs(x) - np.abs(y)
    fold = np.maximum(-z, 0)
    normals = np.stack([x - np.copysign(fold, x), y - np.copysign(fold, y), z], 1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
