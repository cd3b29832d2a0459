"""A bounding volume hierarchy over one mesh, traced by Embree."""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from assets.mesh import Mesh
from sensors.normals import encode_normals


class Bvh:
    """Nearest-hit queries on a mesh, with the surface's properties by triangle.

    Attributes:
        packed_normal: (m,) int32 face normals in the mesh's axes, both int16 of their code in one.
        normal: (m, 3) float32 face normals in the mesh's axes.
        material: (m,) uint8 rows of the material table.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.normal = mesh.normals
        self.packed_normal = encode_normals(self.normal).view(np.int32).reshape(-1)
        self.material = mesh.materials
        self._scene: EmbreeScene | None = None
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
            Distance (n,) float32, `inf` for a miss, and triangle row (n,) int32, −1 for a miss.
        """
        if self._scene is None or len(origin) == 0:
            return np.full(len(origin), np.inf, np.float32), np.full(len(origin), -1, np.int32)
        found = self._scene.run(origin, direction, limit.astype(np.float32), "INTERSECT", output=True)
        triangle = found["primID"]
        distance = found["tfar"]
        distance[triangle < 0] = np.inf
        return distance, triangle
