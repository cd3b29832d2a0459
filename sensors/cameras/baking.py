"""Shade on the static world that never changes: the sun's shadow and the share of sky, by vertex."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from sensors.bvh import Bvh
from sensors.cameras.light import Light

_LIFT_M = 0.05
_SUN_REACH_M = 150.0
_SKY_REACH_M = 12.0
_SKY_DIRECTIONS = 5


def bake_sun_shadows(mesh: Mesh, light: Light, bvh: Bvh | None = None) -> np.ndarray:
    """Share of sun and of sky at each vertex, (n, 2) float32, for `CameraRenderer`'s `static_shade`.

    The sun is seen or not; the sky is seen along a few rays around the vertex's normal, so hollows darken.

    Args:
        mesh: the static world, world axes.
        light: gives the sun's direction.
        bvh: the mesh's own hierarchy where one exists already; building one takes longer than the rays.
    """
    bvh = bvh or Bvh(mesh)
    normal = _vertex_normals(mesh)
    origin = mesh.vertices + _LIFT_M * normal
    sun = np.array(light.sun_direction, np.float32)
    sunlit = ~_blocked(bvh, origin, np.broadcast_to(sun, origin.shape), _SUN_REACH_M)
    sky = np.zeros(len(origin), np.float32)
    for direction in _around(normal):
        sky += ~_blocked(bvh, origin, direction, _SKY_REACH_M)
    return np.stack([sunlit.astype(np.float32), 0.25 + 0.75 * sky / _SKY_DIRECTIONS], 1)


def _blocked(bvh: Bvh, origin: np.ndarray, direction: np.ndarray, reach_m: float) -> np.ndarray:
    limit = np.full(len(origin), reach_m, np.float32)
    _, triangle = bvh.first_hit(origin, np.ascontiguousarray(direction, np.float32), limit)
    return triangle >= 0


def _vertex_normals(mesh: Mesh) -> np.ndarray:
    """Mean of the adjoining faces' unit normals, (n, 3) float32 of unit length; up where they cancel."""
    corners, normals = mesh.faces.ravel(), np.repeat(mesh.normals, 3, axis=0)
    count = len(mesh.vertices)
    total = np.stack([np.bincount(corners, normals[:, axis], count) for axis in range(3)], 1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-6, total / np.maximum(length, 1e-6), (0.0, 0.0, 1.0)).astype(np.float32)


def _around(normal: np.ndarray) -> list[np.ndarray]:
    """Directions (n, 3) spread over the hemisphere of each normal: the pole and a ring at 55°."""
    helper = np.where(np.abs(normal[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    u = np.cross(normal, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normal, u)
    ring = np.arange(_SKY_DIRECTIONS - 1) * (2 * np.pi / (_SKY_DIRECTIONS - 1)) + np.pi / 4
    tilt = np.radians(55.0)
    return [normal] + [np.cos(tilt) * normal + np.sin(tilt) * (np.cos(turn) * u + np.sin(turn) * v) for turn in ring]
