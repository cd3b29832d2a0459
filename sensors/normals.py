"""Unit vectors in two 12-bit numbers: the octahedral encoding (Meyer et al., EGSR 2010)."""

from __future__ import annotations

import numpy as np

_STEPS = 2047
_SCALE = np.float32(1 / _STEPS)


def encode_normals(normals: np.ndarray) -> np.ndarray:
    """Octahedral codes, (n, 2) int16, of unit vectors (n, 3); within 0.05° of the original."""
    x, y, z = np.ascontiguousarray(np.asarray(normals, np.float32).T)
    size = np.abs(x) + np.abs(y) + np.abs(z)
    size[size == 0] = 1
    x, y = x / size, y / size
    below = np.flatnonzero(z < 0)
    under_x, under_y = x[below], y[below]
    x[below] = np.where(under_x >= 0, 1 - np.abs(under_y), np.abs(under_y) - 1)
    y[below] = np.where(under_y >= 0, 1 - np.abs(under_x), np.abs(under_x) - 1)
    codes = np.empty((len(x), 2), np.int16)
    for column, folded in enumerate((x, y)):
        codes[:, column] = np.rint(folded * np.float32(_STEPS))
    return codes


def decode_normals(codes: np.ndarray) -> np.ndarray:
    """Unit vectors, (n, 3) float32, of octahedral codes (n, 2)."""
    normals = np.stack(_unfolded(codes), 1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def dot_with_normals(codes: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Scalar products, (n,) float32, of the unit vectors of codes (n, 2) with `vectors` (n, 3) float32."""
    x, y, z = _unfolded(codes)
    dot = x * vectors[:, 0]
    dot += y * vectors[:, 1]
    dot += z * vectors[:, 2]
    x *= x
    x += np.multiply(y, y, out=y)
    x += np.multiply(z, z, out=z)
    dot /= np.sqrt(x, out=x)
    return dot


def _unfolded(codes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points on the octahedron |x| + |y| + |z| = 1, each coordinate (n,) float32."""
    x, y = codes.T.astype(np.float32, order="C")
    x *= _SCALE
    y *= _SCALE
    z = np.abs(x)
    z += np.abs(y)
    np.subtract(np.float32(1), z, out=z)
    below = np.flatnonzero(z < 0)
    fold, under_x, under_y = z[below], x[below], y[below]
    x[below] = under_x - np.copysign(fold, under_x)
    y[below] = under_y - np.copysign(fold, under_y)
    return x, y, z
