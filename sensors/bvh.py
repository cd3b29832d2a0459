"""A bounding volume hierarchy over one mesh, traced by Embree."""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from assets.materials import material_column
from assets.mesh import Mesh
from sensors.normals import encode_normals

_WORTH_SHARING = 20_000


class Bvh:
    """Nearest-hit queries on a mesh, with the surface's properties by triangle.

    Args:
        mesh: what to hit.
        threads: threads that share a large query; Embree's loop leaves Python's lock.

    Attributes:
        packed_normal: (m,) int32 face normals in the mesh's axes, both int16 of their code in one.
        normal: (m, 3) float32 face normals in the mesh's axes.
        material: (m,) uint8 rows of the material table.
        is_glass: (m,) bool.
    """

    def __init__(self, mesh: Mesh, threads: int = 1) -> None:
        self.normal = mesh.normals
        self.packed_normal = encode_normals(self.normal).view(np.int32).reshape(-1)
        self.material = mesh.materials
        self.is_glass = (material_column("kind") == "glass")[mesh.materials]
        self._scene: EmbreeScene | None = None
        self._threads = ThreadPoolExecutor(threads) if threads > 1 else None
        self._parts = threads
        if len(mesh.faces):
            self._scene = EmbreeScene(robust=True)
            TriangleMesh(self._scene, mesh.vertices, mesh.faces)

    @property
    def is_empty(self) -> bool:
        """True where there is nothing to hit."""
        return self._scene is None

    def first_hit(self, origin: np.ndarray, direction: np.ndarray, limit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest triangle along each ray.

        Args:
            origin: (n, 3) float32.
            direction: (n, 3) float32, of any length; distances are in its multiples.
            limit: (n,) float32 farthest distance; left unchanged.

        Returns:
            Distance (n,) float32, the limit for a miss, and triangle row (n,) int32, −1 for a miss.
        """
        if self._scene is None or len(origin) == 0:
            return limit.astype(np.float32), np.full(len(origin), -1, np.int32)
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
