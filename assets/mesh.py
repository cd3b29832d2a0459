"""A triangle mesh with a material per face, the project's only geometry type."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from assets.materials import MATERIALS, TABLE, MaterialTable

_FACES_AT_ONCE = 1 << 14  # whose temporary arrays fit into a processor's cache


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles and their materials, in metres.

    Vehicle and prop models have their origin at the ground-level centre of their box, x forward, y left,
    z up. World meshes are in world axes (x east, y north, z up). Faces wind counter-clockwise seen from
    outside.

    Attributes:
        vertices: (n, 3) float32.
        faces: (m, 3) int32, rows of `vertices`.
        materials: (m,) uint8, rows of the material table.
    """

    vertices: np.ndarray
    faces: np.ndarray
    materials: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", np.ascontiguousarray(self.vertices, np.float32).reshape(-1, 3))
        object.__setattr__(self, "faces", np.ascontiguousarray(self.faces, np.int32).reshape(-1, 3))
        object.__setattr__(self, "materials", np.ascontiguousarray(self.materials, np.uint8).reshape(-1))
        if len(self.materials) != len(self.faces):
            raise ValueError(f"{len(self.faces)} faces but {len(self.materials)} materials: give one a face")
        if len(self.faces) and (self.faces.min() < 0 or self.faces.max() >= len(self.vertices)):
            raise ValueError(f"faces index vertices outside 0…{len(self.vertices) - 1}")
        if not np.isfinite(self.vertices).all():
            raise ValueError("vertices hold NaN or infinity")

    @classmethod
    def of(cls, vertices: np.ndarray, faces: np.ndarray, material: str, table: MaterialTable = TABLE) -> Mesh:
        """A mesh of one material of a table."""
        faces = np.asarray(faces).reshape(-1, 3)
        return cls(vertices, faces, np.full(len(faces), table.row(material), np.uint8))

    @classmethod
    def empty(cls) -> Mesh:
        """A mesh without faces."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))

    @classmethod
    def merge(cls, meshes: Iterable[Mesh]) -> Mesh:
        """All triangles of several meshes in one, in order."""
        parts = [mesh for mesh in meshes if len(mesh.faces)]
        if not parts:
            return cls.empty()
        offsets = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
        return cls(
            np.concatenate([part.vertices for part in parts]),
            np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)]),
            np.concatenate([part.materials for part in parts]),
        )

    @property
    def bounds(self) -> np.ndarray:
        """Lower and upper corner of the axis-aligned box, (2, 3) float32."""
        return np.stack([self.vertices.min(0), self.vertices.max(0)])

    @property
    def triangles(self) -> np.ndarray:
        """Corner positions, (m, 3, 3) float32."""
        return self.vertices[self.faces]

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit face normals, (m, 3) float32; zero for a degenerate face."""
        normals = np.empty((len(self.faces), 3), np.float32)
        for start in range(0, len(self.faces), _FACES_AT_ONCE):
            block = slice(start, start + _FACES_AT_ONCE)
            a, b, c = (self.vertices[corner].T.astype(np.float64) for corner in self.faces[block].T)
            (ux, uy, uz), (vx, vy, vz) = b - a, c - a
            cross = np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx])
            length = np.sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2])
            normals[block] = np.divide(cross, length, out=np.zeros_like(cross), where=length > 0).T
        return normals

    @cached_property
    def hull(self) -> np.ndarray:
        """Corners of the convex hull, (k, 3) float32; the vertices must span a volume."""
        from scipy.spatial import ConvexHull

        return self.vertices[ConvexHull(self.vertices).vertices]

    def moved(self, offset: np.ndarray | tuple[float, float, float]) -> Mesh:
        """The mesh shifted by `offset` (3,) in metres."""
        return Mesh(self.vertices + np.asarray(offset, np.float32), self.faces, self.materials)

    def transformed(self, pose: np.ndarray) -> Mesh:
        """The mesh carried by a 4 × 4 affine matrix; a mirroring matrix also turns the faces round."""
        pose = np.asarray(pose, np.float64)
        vertices = self.vertices @ pose[:3, :3].T + pose[:3, 3]
        faces = self.faces if np.linalg.det(pose[:3, :3]) > 0 else self.faces[:, ::-1]
        return Mesh(vertices, faces, self.materials)

    def select(self, mask: np.ndarray) -> Mesh:
        """The faces where `mask` (m,) is true, with only the vertices they use."""
        used, faces = np.unique(self.faces[mask], return_inverse=True)
        return Mesh(self.vertices[used], faces.reshape(-1, 3), self.materials[mask])

    def split_glass(self, table: MaterialTable = TABLE) -> tuple[Mesh, Mesh]:
        """The opaque faces and the glass faces as two meshes; `table` is that of the materials."""
        glass = (table.column("kind") == "glass")[self.materials]
        return self.select(~glass), self.select(glass)

    def material_names(self) -> list[str]:
        """Names of the materials in use, in table order."""
        names = list(MATERIALS)
        return [names[index] for index in np.unique(self.materials)]
