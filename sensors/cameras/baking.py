"""Static shading: visibility of the sun and share of visible sky at each vertex."""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np

from assets.mesh import Mesh
from sensors.bvh import Bvh
from sensors.cameras.light import Light

Shade = Callable[[np.ndarray], np.ndarray]
"""Gives the share of sun and of sky, (k, 2) float32 from 0 to 1, at rows (k,) of a world's vertices."""

_WORLD_LIFT_M, _MODEL_LIFT_M = 0.05, 0.01  # distance of ray origins from the surface
_SUN_REACH_M = 150.0
_WORLD_SKY_REACH_M, _MODEL_SKY_REACH_M = 12.0, 2.0
_WORLD_RINGS = ((55.0, 4),)  # rays round the normal: tilt [deg], number
_MODEL_RINGS = ((35.0, 6), (65.0, 10))
_DARKEST = 0.25  # light that reaches the deepest hollow by reflection


class SunShadows:
    """Share of sun and of sky at vertices of a static world, computed on demand.

    The sun is seen or not; the sky is seen along a few rays around the vertex's normal, so hollows darken.

    Args:
        mesh: the static world, world axes.
        light: gives the sun's direction.
        bvh: the mesh's own hierarchy where one exists already; building one takes longer than the rays.
        normals: (n, 3) `vertex_normals` of the mesh where they are computed already.
    """

    def __init__(self, mesh: Mesh, light: Light, bvh: Bvh | None = None, normals: np.ndarray | None = None) -> None:
        self._vertices = mesh.vertices
        self._normal = vertex_normals(mesh) if normals is None else normals
        self._sky = np.full(len(mesh.vertices), np.nan, np.float32)  # computed on demand
        self._sun = np.array(light.sun_direction, np.float32)
        self._bvh = bvh or Bvh(mesh)

    def under(self, light: Light) -> SunShadows:
        """Return the shading in another light; the share of sky is computed once for both."""
        other = copy.copy(self)
        other._sun = np.array(light.sun_direction, np.float32)
        return other

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        """Sun and sky, (k, 2) float32, 0–1, at some rows (k,) of the vertices."""
        origin = self._vertices[rows] + _WORLD_LIFT_M * self._normal[rows]
        sunlit = ~self._bvh.blocks(origin, np.tile(self._sun, (len(origin), 1)), _SUN_REACH_M)
        new = np.isnan(self._sky[rows])
        requested = rows[new]
        self._sky[requested] = _sky_share(
            self._bvh, origin[new], self._normal[requested], _WORLD_RINGS, _WORLD_SKY_REACH_M
        )
        return np.stack([sunlit.astype(np.float32), self._sky[rows]], 1)


def bake_hollows(mesh: Mesh) -> np.ndarray:
    """(n, 2) float32 share of light at each vertex of a model on the ground, for any heading.

    Sun and sky have the same share, since the sun may be in any direction: cabins and undersides are darker.
    """
    low, high = mesh.bounds
    (x0, y0), (x1, y1) = low[:2] - 2, high[:2] + 2
    corners = np.array([(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)])
    floor = Mesh.of(corners, np.array([(0, 1, 2), (0, 2, 3)]), "asphalt")
    normal = vertex_normals(mesh)
    origin = mesh.vertices + _MODEL_LIFT_M * normal
    sky = _sky_share(Bvh(Mesh.merge([mesh, floor])), origin, normal, _MODEL_RINGS, _MODEL_SKY_REACH_M)
    sky = _spread(mesh, sky[mesh.faces].mean(1, keepdims=True))[:, 0]
    return np.stack([sky, sky], 1)


def _sky_share(
    bvh: Bvh, origin: np.ndarray, normal: np.ndarray, rings: tuple[tuple[float, int], ...], reach_m: float
) -> np.ndarray:
    directions = _around(normal, rings)
    free = np.zeros(len(origin), np.float32)
    for direction in directions:
        free += ~bvh.blocks(origin, np.ascontiguousarray(direction, np.float32), reach_m)
    return _DARKEST + (1.0 - _DARKEST) * free / len(directions)


def _spread(mesh: Mesh, values: np.ndarray) -> np.ndarray:
    """Mean at each vertex (n, k) of the values of its faces (m, k); 0 without faces."""
    corners, n_vertices = mesh.faces.ravel(), len(mesh.vertices)
    n_faces = np.maximum(np.bincount(corners, minlength=n_vertices), 1)
    mean = np.empty((n_vertices, values.shape[1]))
    for column, of_faces in zip(mean.T, values.T, strict=True):
        column[:] = np.bincount(corners, np.repeat(of_faces, 3), n_vertices) / n_faces
    return mean


def vertex_normals(mesh: Mesh) -> np.ndarray:
    """Mean of the adjoining faces' unit normals, (n, 3) float32 of unit length; up where they cancel."""
    mean = _spread(mesh, mesh.normals)
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    mean /= np.maximum(length, 1e-6)
    mean[length[:, 0] <= 1e-6] = (0.0, 0.0, 1.0)
    return mean.astype(np.float32)


def _around(normal: np.ndarray, rings: tuple[tuple[float, int], ...]) -> list[np.ndarray]:
    """Directions (n, 3) spread over the hemisphere of each normal: the pole and rings about it."""
    helper = np.where(np.abs(normal[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    u = np.cross(normal, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normal, u)
    directions = [normal]
    for tilt_deg, number in rings:
        tilt = np.radians(tilt_deg)
        for turn in (np.arange(number) + 0.5) * (2 * np.pi / number):
            sideways = np.cos(turn) * u + np.sin(turn) * v
            directions.append(np.cos(tilt) * normal + np.sin(tilt) * sideways)
    return directions
