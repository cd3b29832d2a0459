"""The world as rays meet it: one static BVH, a pair of BVHs (with and without glass) per model, posed instances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from assets.materials import TABLE, MaterialTable
from assets.mesh import Mesh
from sensors.bvh import Bvh


@dataclass(frozen=True, eq=False)
class Instances:
    """All movable objects at one instant, as a struct of arrays.

    Attributes:
        ids: n identifiers.
        kinds: n kinds (`car`, `van`, `truck`, `bus`, `tram`, `motorcycle`, `cyclist`, `pedestrian`, `person_sitting`).
        models: n model names.
        poses: (n, 4, 4) float64 world poses of the model frames (ground-level centre of the box, x forward).
        scales: (n, 3) float64 applied before the pose.
        sizes: (n, 3) float64 length, width, height of the scaled box [m].
        velocity_mps: (n, 3) float64 world velocity.
        yaw_rate_radps: (n,) float64, positive counter-clockwise.
        paint: (n,) float32 reflectance of the paint at 905 nm, 0–1.
        rgb: (n, 3) float32 visible colour of the paint, linear, 0–1.
    """

    ids: tuple[str, ...]
    kinds: tuple[str, ...]
    models: tuple[str, ...]
    poses: np.ndarray
    scales: np.ndarray
    sizes: np.ndarray
    velocity_mps: np.ndarray
    yaw_rate_radps: np.ndarray
    paint: np.ndarray
    rgb: np.ndarray

    def __len__(self) -> int:
        return len(self.ids)

    def take(self, rows: np.ndarray) -> Instances:
        """The instances at `rows`."""
        columns: dict[str, Any] = {}
        numbers = rows.tolist()
        for field in fields(self):
            column = getattr(self, field.name)
            columns[field.name] = tuple([column[row] for row in numbers]) if isinstance(column, tuple) else column[rows]
        return Instances(**columns)

    def and_then(self, others: Instances) -> Instances:
        """These and after them others of the same instant."""
        columns: dict[str, Any] = {}
        for field in fields(self):
            ones, more = getattr(self, field.name), getattr(others, field.name)
            columns[field.name] = (*ones, *more) if isinstance(ones, tuple) else np.concatenate([ones, more])
        return Instances(**columns)


@dataclass(frozen=True, eq=False)
class TracedModel:
    """A model ready for tracing.

    Attributes:
        mesh: its triangles.
        table: of the mesh's materials.
    """

    mesh: Mesh
    table: MaterialTable = TABLE

    @cached_property
    def whole(self) -> Bvh:
        """All its faces."""
        return Bvh(self.mesh, instance=0, table=self.table)

    @cached_property
    def opaque(self) -> Bvh:
        """The faces that are not glass, for the beams that meet glass first."""
        opaque, glass = self.mesh.split_glass(self.table)
        return Bvh(opaque, instance=0, table=self.table) if len(glass.faces) else self.whole

    @property
    def vertices(self) -> np.ndarray:
        """(n, 3) float32 of its mesh."""
        return self.mesh.vertices

    @cached_property
    def bounds(self) -> np.ndarray:
        """(2, 3) float64 corners of its box."""
        return self.mesh.bounds.astype(np.float64)


class Scene:
    """Static world and model library, built once and shared by every frame.

    Args:
        static: the static world in world axes, coordinates within about a kilometre of the origin.
        load_model: gives the mesh of a model name; called once a model, when first met.
        threads: threads that share a query of the static world.
        table: what the materials of all meshes are.
        models: those built already, shared with other worlds of the same table.
    """

    def __init__(
        self,
        static: Mesh,
        load_model: Callable[[str], Mesh],
        threads: int = 1,
        table: MaterialTable = TABLE,
        models: dict[str, TracedModel] | None = None,
    ) -> None:
        self.table = table
        self.static = Bvh(static, threads, table=table)
        self._load_model = load_model
        self._models = {} if models is None else models

    def model(self, name: str) -> TracedModel:
        """The traced model of a name, built on first use."""
        if name not in self._models:
            self._models[name] = TracedModel(self._load_model(name), self.table)
        return self._models[name]
