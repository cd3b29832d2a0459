"""A bounding volume hierarchy over one mesh, traced by Embree."""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene

from assets.materials import TABLE, MaterialTable
from assets.mesh import Mesh
from sensors.hit_buffer import face_records
from sensors.hits import STATIC

_WORTH_SHARING = 20_000


class Bvh:
    """Nearest-hit queries on a mesh, with the surface's properties by triangle.

    Args:
        mesh: triangles.
        threads: threads that share a large query; Embree's loop releases Python's global lock.
        instance: what hits report: −1 the static world, 0 a model, whose row comes later.
        table: of the mesh's materials.
    """

    def __init__(self, mesh: Mesh, threads: int = 1, instance: int = STATIC, table: MaterialTable = TABLE) -> None:
        self._mesh, self._instance, self._table = mesh, instance, table
        self._scene: EmbreeScene | None = None
        self._threads = ThreadPoolExecutor(threads) if threads > 1 else None
        self._parts = threads
        if len(mesh.faces):
            self._scene = EmbreeScene(_device(), robust=True)
            TriangleMesh(self._scene, mesh.vertices, mesh.faces)

    @cached_property
    def normal(self) -> np.ndarray:
        """(m, 3) float32 face normals in the mesh's axes."""
        return self._mesh.normals

    @cached_property
    def is_glass(self) -> np.ndarray:
        """(m,) bool."""
        return (self._table.column("kind") == "glass")[self._mesh.materials]

    @cached_property
    def records(self) -> np.ndarray:
        """(m + 1,) int64, what `HitBuffer` keeps of each face; the last is that of a miss."""
        return face_records(self.normal, self._mesh.materials, self.is_glass, self._instance)

    @property
    def is_empty(self) -> bool:
        """Whether the mesh has no triangles."""
        return self._scene is None

    def first_hit(
        self, origin: np.ndarray, direction: np.ndarray, limit: np.ndarray, near: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the nearest triangle along each ray.

        Args:
            origin: (n, 3) float32.
            direction: (n, 3) float32, of any length; distances are in its multiples.
            limit: (n,) float32 farthest distance; left unchanged.
            near: smallest distance of a surface.

        Returns:
            Distance (n,) float32, the limit for a miss, and triangle row (n,) int32, −1 for a miss.
        """
        if self._scene is None or len(origin) == 0:
            return limit.astype(np.float32), np.full(len(origin), -1, np.int32)
        distance, triangle = self._shared_query(origin, direction, limit)
        close = np.flatnonzero(distance < near)  # Embree itself knows no nearest distance here
        if len(close):
            start, onward = origin[close] + direction[close] * np.float32(near), direction[close]
            step, triangle[close] = self._shared_query(start, onward, limit[close] - np.float32(near))
            distance[close] = step + np.float32(near)
        return distance, triangle

    def blocks(self, origin: np.ndarray, direction: np.ndarray, reach_m: float) -> np.ndarray:
        """Whether a triangle lies on each ray, (n,) bool; faster than `first_hit`, because any triangle suffices.

        Args:
            origin: (n, 3) float32.
            direction: (n, 3) float32 unit vectors.
            reach_m: largest distance of a triangle [m].
        """
        if self._scene is None or len(origin) == 0:
            return np.zeros(len(origin), bool)
        limit = np.full(len(origin), reach_m, np.float32)
        return self._scene.run(origin, direction, limit, "OCCLUDED") == 0

    def _shared_query(
        self, origin: np.ndarray, direction: np.ndarray, limit: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        if self._threads is None or len(origin) < _WORTH_SHARING:
            return self._query(origin, direction, limit)
        cuts = np.linspace(0, len(origin), 2 * self._parts + 1).astype(int)
        parts = [slice(start, stop) for start, stop in itertools.pairwise(cuts)]
        found = self._threads.map(lambda part: self._query(origin[part], direction[part], limit[part]), parts)
        distance, triangle = zip(*found, strict=True)
        return np.concatenate(distance), np.concatenate(triangle)

    def _query(self, origin: np.ndarray, direction: np.ndarray, limit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        assert self._scene is not None
        # Embree writes into the limits it is given.
        found = self._scene.run(origin, direction, limit.astype(np.float32), "INTERSECT", output=True)
        return found["tfar"], found["primID"]


@cache
def _device() -> EmbreeDevice:
    """Return the process's only Embree device; each one uses thread keys, of which a process has about a thousand."""
    return EmbreeDevice()
