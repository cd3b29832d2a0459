"""A model in the form that the graphics library draws, made once for all renderers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.cache import cached
from assets.mesh import Mesh
from sensors.cameras.baking import bake_hollows
from sensors.cameras.closed import closed_faces
from sensors.cameras.detail import coarsened
from sensors.cameras.packing import PackedMesh, drawable, pack


@dataclass(frozen=True, eq=False)
class PackedModel:
    """One level of detail of a model.

    Attributes:
        mesh: faces of closed surfaces first.
        n_closed: how many those are.
    """

    mesh: PackedMesh
    n_closed: int


@cached
def pack_model(mesh: Mesh, cell_m: float) -> PackedModel:
    """A model on a grid of `cell_m` [m] (0: unchanged), without parts that are not drawn and with hollows darkened."""
    mesh = drawable(coarsened(mesh, cell_m))
    closed = closed_faces(mesh)
    order = np.argsort(~closed, kind="stable")
    ordered = Mesh(mesh.vertices, mesh.faces[order], mesh.materials[order])
    return PackedModel(pack(ordered, bake_hollows(ordered)), int(closed.sum()))
