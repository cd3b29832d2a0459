"""Models in graphics memory, loaded when first seen, and the choice of instances worth drawing. Imports OpenGL."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from assets.mesh import Mesh
from sensors.cameras.buffers import InstanceBuffer, MeshBuffer, back_faces
from sensors.cameras.closed import closed_faces
from sensors.cameras.packing import drawable, pack
from sensors.cameras.projection import spheres_inside

if TYPE_CHECKING:
    from sensors.scene import Instances


@dataclass(frozen=True, eq=False)
class _Model:
    buffer: MeshBuffer
    closed: slice  # faces of closed surfaces
    rest: slice  # all other faces
    centre: np.ndarray  # of the bounding sphere, model axes [m]
    half: np.ndarray  # half extents of the box [m]


class ModelLibrary:
    """Every model once, drawn for all its visible instances together."""

    def __init__(self, load: Callable[[str], Mesh]) -> None:
        self._load = load
        self._models: dict[str, _Model] = {}
        self._instances = InstanceBuffer()

    def draw(self, instances: Instances, camera_from_world: np.ndarray, planes: np.ndarray) -> None:
        """Draw the instances inside the frustum; the program must be in use.

        Args:
            instances: all instances; the k-th carries number k + 1.
            camera_from_world: (4, 4) float64.
            planes: (6, 4) float64 frustum planes, world axes.
        """
        rows = self._in_view(instances, planes)
        if not len(rows):
            return
        names, group = np.unique([instances.models[row] for row in rows], return_inverse=True)
        order = np.argsort(group, kind="stable")
        rows, group = rows[order], group[order]
        self._instances.fill(_instance_matrices(instances, rows, camera_from_world))
        edges = np.searchsorted(group, np.arange(len(names) + 1)).tolist()
        groups = [(self._models[name], slice(*edges[k : k + 2])) for k, name in enumerate(names)]
        with back_faces(drawn=False):
            for model, members in groups:
                model.buffer.draw_instances(model.closed, members)
        for model, members in groups:
            model.buffer.draw_instances(model.rest, members)

    def _in_view(self, instances: Instances, planes: np.ndarray) -> np.ndarray:
        if not len(instances.models):
            return np.zeros(0, np.int64)
        models = [self._model(name) for name in instances.models]
        scales = np.asarray(instances.scales, np.float64)
        poses = np.asarray(instances.poses, np.float64)
        centre = np.stack([model.centre for model in models]) * scales
        radius = np.linalg.norm(np.stack([model.half for model in models]) * scales, axis=1)
        world = np.einsum("nij,nj->ni", poses[:, :3, :3], centre) + poses[:, :3, 3]
        return np.flatnonzero(spheres_inside(planes, world, radius))

    def _model(self, name: str) -> _Model:
        if name not in self._models:
            self._models[name] = self._loaded(self._load(name))
        return self._models[name]

    def _loaded(self, mesh: Mesh) -> _Model:
        low, high = mesh.bounds.astype(np.float64)
        mesh = drawable(mesh)
        closed = closed_faces(mesh)
        order = np.argsort(~closed, kind="stable")
        sorted_mesh = Mesh(mesh.vertices, mesh.faces[order], mesh.materials[order])
        n_closed = int(closed.sum())
        return _Model(
            MeshBuffer(pack(sorted_mesh), self._instances),
            slice(0, n_closed),
            slice(n_closed, len(order)),
            (low + high) / 2,
            (high - low) / 2,
        )


def _instance_matrices(instances: Instances, rows: np.ndarray, camera_from_world: np.ndarray) -> np.ndarray:
    """Camera-from-model matrices (n, 4, 4) float32; the last row holds paint rgb and instance number."""
    matrices = camera_from_world @ np.asarray(instances.poses, np.float64)[rows]
    matrices[:, :3, :3] *= np.asarray(instances.scales, np.float64)[rows, None, :]
    matrices[:, 3, :3] = np.asarray(instances.rgb)[rows]
    matrices[:, 3, 3] = rows + 1
    return matrices.astype(np.float32)
