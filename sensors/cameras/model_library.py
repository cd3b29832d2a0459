"""Models in graphics memory, loaded when first seen, and the choice of instances worth drawing. Imports OpenGL."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from assets.mesh import Mesh
from sensors.cameras.buffers import InstanceBuffer, MeshBuffer, back_faces
from sensors.cameras.detail import CELLS_M, coarsened, level_of
from sensors.cameras.occlusion import box_corners
from sensors.cameras.packed_model import PackedModel, pack_model
from sensors.cameras.projection import View, spheres_inside

if TYPE_CHECKING:
    from sensors.scene import Instances


@dataclass(frozen=True, eq=False)
class _Model:
    buffer: MeshBuffer
    closed: slice  # faces of closed surfaces
    rest: slice  # all other faces


class ModelLibrary:
    """Every model once, drawn for all its visible instances together.

    Args:
        load: gives the mesh of a name.
        packed: (name, level of detail) → what is packed already, added to.
    """

    def __init__(self, load: Callable[[str], Mesh], packed: dict[tuple[str, int], PackedModel]) -> None:
        self._load = load
        self._packed = packed
        self._models: dict[tuple[str, int], _Model] = {}
        self._bounds: dict[str, np.ndarray] = {}
        self._instances = InstanceBuffer()
        self._boxed: tuple[Instances, np.ndarray] | None = None

    def in_view(self, instances: Instances, planes: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) of the instances inside the frustum, nearest first, and their boxes' corners (k, 8, 3).

        Args:
            instances: everything that moves.
            planes: (6, 4) float64 frustum planes, world axes.
            eye: (3,) camera centre, world axes.
        """
        if not len(instances.models):
            return np.zeros(0, np.int64), np.zeros((0, 8, 3))
        corners = self._corners(instances)
        centre = (corners[:, 0] + corners[:, -1]) / 2
        radius = np.linalg.norm(corners[:, 0] - centre, axis=1)
        rows = np.flatnonzero(spheres_inside(planes, centre, radius))
        rows = rows[np.argsort(np.linalg.norm(centre[rows] - eye, axis=1), kind="stable")]
        return rows, corners[rows]

    def _corners(self, instances: Instances) -> np.ndarray:
        """Corners of all boxes, (n, 8, 3) world axes, kept for the next camera that sees the same instances."""
        if self._boxed is None or self._boxed[0] is not instances:
            bounds = np.stack([self._box(name) for name in instances.models])
            poses = np.asarray(instances.poses, np.float64)
            local = box_corners(bounds * np.asarray(instances.scales, np.float64)[:, None])
            corners = local @ poses[:, :3, :3].swapaxes(1, 2) + poses[:, None, :3, 3]
            self._boxed = instances, corners
        return self._boxed[1]

    def draw(self, instances: Instances, rows: np.ndarray, view: View) -> None:
        """Draw some instances; instance k carries number k + 1, and the program must be in use.

        Args:
            instances: everything that moves.
            rows: (k,) which to draw.
            view: the camera.
        """
        if not len(rows):
            return
        matrices = _instance_matrices(instances, rows, view.camera_from_world)
        levels = level_of(matrices[:, 2, 3], view.focal_px).tolist()
        kinds = [(instances.models[row], level) for row, level in zip(rows, levels, strict=True)]
        order = sorted(range(len(kinds)), key=kinds.__getitem__)
        self._instances.fill(matrices[order])
        groups, start = [], 0
        for kind, members in groupby(order, key=kinds.__getitem__):
            stop = start + len(list(members))
            groups.append((self._model(*kind), slice(start, stop)))
            start = stop
        with back_faces(drawn=False):
            for model, members in groups:
                model.buffer.draw_instances(model.closed, members)
        for model, members in groups:
            model.buffer.draw_instances(model.rest, members)

    def _box(self, name: str) -> np.ndarray:
        if name not in self._bounds:
            self._bounds[name] = self._load(name).bounds.astype(np.float64)
        return self._bounds[name]

    def _model(self, name: str, level: int) -> _Model:
        key = name, level
        if key not in self._models:
            if key not in self._packed:
                self._packed[key] = pack_model(coarsened(self._load(name), CELLS_M[level]))
            mesh, n_closed = self._packed[key].mesh, self._packed[key].n_closed
            self._models[key] = _Model(
                MeshBuffer(mesh, self._instances), slice(0, n_closed), slice(n_closed, len(mesh.faces))
            )
        return self._models[key]


def _instance_matrices(instances: Instances, rows: np.ndarray, camera_from_world: np.ndarray) -> np.ndarray:
    """Camera-from-model matrices (n, 4, 4) float32; the last row holds paint rgb and instance number."""
    matrices = camera_from_world @ np.asarray(instances.poses, np.float64)[rows]
    matrices[:, :3, :3] *= np.asarray(instances.scales, np.float64)[rows, None, :]
    matrices[:, 3, :3] = np.asarray(instances.rgb)[rows]
    matrices[:, 3, 3] = rows + 1
    return matrices.astype(np.float32)
