"""Coarser versions of a model for where its triangles are smaller than pixels.

Vertices are clustered on a grid (Rossignac and Borrel, 1993); each cluster keeps its outermost vertex, so that
the silhouette stays. Parts visible only through windows are left out; the panes are drawn dark instead.
"""

from __future__ import annotations

import numpy as np

from assets.materials import MATERIALS, material_index
from assets.mesh import Mesh

CELLS_M = (0.0, 0.10, 0.25)  # grid of each level; 0 is the model itself
_COARSE_FACES = 2000
_MOST_PX = 2.0  # a cell may cover this many pixels
_INNER = ("car_interior", "car_seat", "underbody")


def coarsened(mesh: Mesh, cell_m: float) -> Mesh:
    """The mesh on a grid of `cell_m`, without its inside; the mesh itself for 0, or where it is coarse already.

    People are: their thin limbs would not survive, and they cost little.
    """
    if cell_m == 0 or len(mesh.faces) < _COARSE_FACES:
        return mesh
    shell = _shell(mesh)
    middle = shell.bounds.mean(0)
    half = np.maximum(np.ptp(shell.bounds, axis=0) / 2, 1e-6)
    cell = np.floor(shell.vertices / cell_m).astype(np.int64)
    outermost_first = np.argsort(-np.linalg.norm((shell.vertices - middle) / half, axis=1), kind="stable")
    _, chosen, cluster = np.unique(cell[outermost_first], axis=0, return_index=True, return_inverse=True)
    cluster_of = np.empty(len(shell.vertices), np.int64)
    cluster_of[outermost_first] = cluster.ravel()
    faces = cluster_of[shell.faces]
    kept = (faces != np.roll(faces, 1, axis=1)).all(1)
    _, first = np.unique(np.sort(faces[kept], axis=1), axis=0, return_index=True)
    first.sort()
    return Mesh(shell.vertices[outermost_first][chosen], faces[kept][first], shell.materials[kept][first])


def level_of(depth_m: np.ndarray, focal_px: float) -> np.ndarray:
    """Level of detail at each depth, (n,) int: the coarsest whose cells are small enough on the image."""
    cell_px = focal_px * np.array(CELLS_M) / np.maximum(np.asarray(depth_m), 0.1)[:, None]
    return (cell_px <= _MOST_PX).sum(1) - 1


def _shell(mesh: Mesh) -> Mesh:
    inside = np.isin(mesh.materials, [material_index(name) for name in _INNER])
    glass = np.isin(mesh.materials, [material_index(name) for name, m in MATERIALS.items() if m.kind == "glass"])
    materials = np.where(glass, np.uint8(material_index("car_interior")), mesh.materials)
    shell = Mesh(mesh.vertices, mesh.faces, materials)
    return shell.select(~inside) if not inside.all() else shell
