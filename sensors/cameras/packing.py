"""Meshes packed for flat shading: few vertices, one of each face carrying its colour and normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.materials import material_column
from assets.mesh import Mesh

VERTEX = np.dtype(
    [
        ("position", "<f4", 3),  # metres, mesh axes
        ("normal", "i1", 4),  # unit normal × 127 of the face the vertex speaks for
        ("colour", "u1", 4),  # square root of the linear albedo × 255; alpha 255 takes the instance's paint
        ("shade", "u1", 4),  # share of sun and of sky that reaches the vertex × 255; material row + 1; 255 if it glows
    ]
)


@dataclass(frozen=True, eq=False)
class PackedMesh:
    """Triangles as the graphics card takes them, without glass.

    Attributes:
        vertices: (n,) of `VERTEX`.
        faces: (m, 3) uint32; colour and normal come from each face's last corner.
    """

    vertices: np.ndarray
    faces: np.ndarray


def drawable(mesh: Mesh) -> Mesh:
    """The mesh without glass, which cameras and beams pass, and without faces of no area; same vertices."""
    keep = ~(material_column("kind") == "glass")[mesh.materials] & mesh.normals.any(1)
    return Mesh(mesh.vertices, mesh.faces[keep], mesh.materials[keep])


def pack(mesh: Mesh, shade: np.ndarray | None = None) -> PackedMesh:
    """Give every face a last corner of its own colour and normal; faces keep their order.

    Args:
        mesh: a `drawable` mesh.
        shade: (n, 2) share of sun and sky, 0–1, per vertex of `mesh`; None for full light.
    """
    normal = mesh.normals
    keep = ~(material_column("kind") == "glass")[mesh.materials] & normal.any(1)
    faces, material = mesh.faces[keep].astype(np.int64), mesh.materials[keep]
    codes = np.zeros((len(faces), 4), np.int8)
    codes[:, :3] = np.rint(normal[keep] * 127)
    codes[:, 3] = material.view(np.int8)
    faces, source, speaker = _provoking_corners(
        faces, codes.view(np.uint32).ravel().astype(np.int64), len(mesh.vertices)
    )

    vertices = np.zeros(len(source), VERTEX)
    vertices["position"] = mesh.vertices[source]
    vertices["shade"] = 255
    if shade is not None:
        vertices["shade"][:, :2] = np.rint(np.clip(shade[source], 0.0, 1.0) * 255)
    codes = speaker.astype(np.uint32).view(np.int8).reshape(-1, 4)
    vertices["normal"][:, :3] = codes[:, :3]
    palette = np.empty((len(material_column("paint")), 4), np.uint8)
    palette[:, :3] = np.rint(np.sqrt(material_column("rgb")) * 255)
    palette[:, 3] = material_column("paint") * 255
    row = codes[:, 3].view(np.uint8)
    vertices["colour"] = palette[row]
    vertices["shade"][:, 2] = row + 1
    vertices["shade"][:, 3] = material_column("glow")[row] * np.uint8(255)
    return PackedMesh(vertices, faces.astype(np.uint32))


def _provoking_corners(
    faces: np.ndarray, key: np.ndarray, n_vertices: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rotate the corners of each face so that its last corner is a vertex that only this face's key uses.

    A vertex represents one key; faces of equal key share it. Faces without a free vertex get a copy of one.

    Returns:
        Faces (m, 3), the original vertex of each new vertex (k,), and the key that each new vertex represents.
    """
    owner = np.full(n_vertices, -1, np.int64)
    corner = np.full(len(faces), -1, np.int64)
    for candidate in range(3):
        todo = np.flatnonzero(corner < 0)
        vertex = faces[todo, candidate]
        free = owner[vertex] < 0
        owner[vertex[free]] = key[todo[free]]
        agrees = owner[faces[todo]] == key[todo, None]
        corner[todo] = np.where(agrees.any(1), agrees.argmax(1), -1)
    rest = np.flatnonzero(corner < 0)
    copies, which = np.unique(np.stack([faces[rest, 2], key[rest]], 1), axis=0, return_inverse=True)
    corner[rest] = 2
    turned = np.take_along_axis(faces, (corner[:, None] + (1, 2, 3)) % 3, 1)
    turned[rest, 2] = n_vertices + which.ravel()

    source = np.concatenate([np.arange(n_vertices), copies[:, 0]])
    speaker = np.concatenate([np.maximum(owner, 0), copies[:, 1]])
    return _in_order_of_use(turned, source, speaker)


def _in_order_of_use(
    faces: np.ndarray, source: np.ndarray, speaker: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Renumber vertices by first use, dropping unused ones: neighbours in the mesh lie together in memory."""
    used, first, compact = np.unique(faces, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(used), np.int64)
    rank[order] = np.arange(len(used))
    return rank[compact].reshape(-1, 3), source[used[order]], speaker[used[order]]
