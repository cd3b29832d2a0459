"""Models in graphics memory, loaded on first use, and the choice of visible instances. Imports OpenGL."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from assets.mesh import Mesh
from sensors.cameras.buffers import GrowingBuffer, InstanceBuffer, back_faces
from sensors.cameras.detail import CELLS_M, level_of
from sensors.cameras.occlusion import box_corners
from sensors.cameras.packed_model import PackedModel, pack_model
from sensors.cameras.projection import View, spheres_inside

if TYPE_CHECKING:
    from sensors.scene import Instances


@dataclass(frozen=True, eq=False)
class _Model:
    first: int  # face in the buffer; those of closed surfaces come first
    n_closed: int
    n_faces: int


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
        self._buffer = GrowingBuffer(self._instances)
        self._boxed: tuple[Instances, np.ndarray] | None = None

    def in_view(self, instances: Instances, planes: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) of the instances inside the frustum, nearest first, and their boxes' corners (k, 8, 3).

        Args:
            instances: movable objects.
            planes: (6, 4) float64 frustum planes, world axes.
            eye: (3,) camera centre, world frame.
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
            instances: movable objects.
            rows: (k,) which to draw.
            view: the camera.
        """
        if not len(rows):
            return
        matrices = _instance_matrices(instances, rows, view.camera_from_world)
        levels = level_of(matrices[:, 2, 3], view.focal_px).tolist()
        types = [(instances.models[row], level) for row, level in zip(rows, levels, strict=True)]
        order = sorted(range(len(types)), key=types.__getitem__)
        self._instances.fill(matrices[order])
        closed, rest, start = [], [], 0
        for kind, members in groupby(order, key=types.__getitem__):
            model, count = self._model(*kind), len(list(members))
            closed.append((model.first, model.n_closed, start, count))
            rest.append((model.first + model.n_closed, model.n_faces - model.n_closed, start, count))
            start += count
        with back_faces(drawn=False):
            self._buffer.draw_instances(np.array(closed))
        self._buffer.draw_instances(np.array(rest))

    def _box(self, name: str) -> np.ndarray:
        if name not in self._bounds:
            self._bounds[name] = self._load(name).bounds.astype(np.float64)
        return self._bounds[name]

    def _model(self, name: str, level: int) -> _Model:
        key = name, level
        if key not in self._models:
            if key not in self._packed:
                self._packed[key] = pack_model(self._load(name), CELLS_M[level])
            packed = self._packed[key]
            self._models[key] = _Model(self._buffer.add(packed.mesh), packed.n_closed, len(packed.mesh.faces))
        return self._models[key]


def _instance_matrices(instances: Instances, rows: np.ndarray, camera_from_world: np.ndarray) -> np.ndarray:
    """Camera-from-model matrices (n, 4, 4) float32; the last row holds paint rgb and instance number."""
    matrices = camera_from_world @ np.asarray(instances.poses, np.float64)[rows]
    matrices[:, :3, :3] *= np.asarray(instances.scales, np.float64)[rows, None, :]
    matrices[:, 3, :3] = np.asarray(instances.rgb)[rows]
    matrices[:, 3, 3] = rows + 1
    return matrices.astype(np.float32)
