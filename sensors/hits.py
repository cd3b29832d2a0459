"""Surfaces hit by the beams: the first solid surface, and the pane of glass in front of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from assets.materials import TABLE, MaterialTable
from sensors.normals import decode_normals, dot_with_normals
from sensors.rays import Rays

RANGE_STEP_M = 1e-4
STATIC, NOTHING = -1, -2


@dataclass(frozen=True, eq=False)
class Surface:
    """One surface point per beam.

    Attributes:
        range_m: (n,) float32 distance along the beam from its optical centre, a multiple of 0.1 mm;
            `inf` where there is none.
        normal_code: (n, 2) int16 encoded face normal in world axes.
        material: (n,) uint8 row of the material table.
        instance: (n,) int16 row of the frame's instances, −1 the static world, −2 nothing.
        measured: (n,) float32 reflectance at 905 nm of each point where it was measured; NaN where that of the
            material or paint applies. None: nowhere measured.
    """

    range_m: np.ndarray
    normal_code: np.ndarray
    material: np.ndarray
    instance: np.ndarray
    measured: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.range_m)

    @property
    def exists(self) -> np.ndarray:
        """(n,) bool: whether there is a surface."""
        return self.instance != NOTHING

    @property
    def normal(self) -> np.ndarray:
        """Unit face normals in world axes, (n, 3) float32."""
        return decode_normals(self.normal_code)

    def take(self, rows: np.ndarray) -> Surface:
        """The surfaces at `rows`."""
        measured = None if self.measured is None else self.measured[rows]
        return Surface(self.range_m[rows], self.normal_code[rows], self.material[rows], self.instance[rows], measured)


@dataclass(frozen=True, eq=False)
class Hits:
    """The traced world behind every beam of a revolution.

    Attributes:
        rays: the n beams, in LiDAR axes.
        pose: (4, 4) float64 world pose of the LiDAR.
        solid: the first non-glass surface of each beam (n).
        pane_beam: (k,) int32 rows of the beams that meet glass before it.
        pane: the first pane of each of those (k).
        paint: (m,) float32 reflectance at 905 nm of each instance's paint.
        table: what material rows mean.
        carried: (n, 3) float32 directions of the beams in world axes, where tracing has them at hand.
    """

    rays: Rays
    pose: np.ndarray
    solid: Surface
    pane_beam: np.ndarray
    pane: Surface
    paint: np.ndarray
    table: MaterialTable = TABLE
    carried: np.ndarray | None = None

    @cached_property
    def direction(self) -> np.ndarray:
        """Directions of the beams at `pose`, (n, 3) float32 world axes."""
        if self.carried is not None:
            return self.carried
        return self.rays.direction @ self.pose[:3, :3].T.astype(np.float32)

    @cached_property
    def first(self) -> Surface:
        """The first surface of each beam, glass or not (n)."""
        merged = [
            column.copy()
            for column in (self.solid.range_m, self.solid.normal_code, self.solid.material, self.solid.instance)
        ]
        pane = (self.pane.range_m, self.pane.normal_code, self.pane.material, self.pane.instance)
        for column, values in zip(merged, pane, strict=True):
            column[self.pane_beam] = values
        return Surface(*merged)

    def cos_incidence(self, surface: Surface, beams: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Cosine between beam and face normal, (n,) float32 in 0–1, of surfaces met by `beams`."""
        direction = self.direction[beams] if isinstance(beams, slice) else self.direction.take(beams, axis=0)
        cos = dot_with_normals(surface.normal_code, direction)
        return np.minimum(np.abs(cos, out=cos), np.float32(1), out=cos)

    def reflectance(self, surface: Surface) -> np.ndarray:
        """Diffuse reflectance at 905 nm, (n,) float32: measured, of the instance's paint, or of the material."""
        values = self.table.column("reflectance").astype(np.float32).take(surface.material)
        moving = np.flatnonzero(surface.instance >= 0)
        painted = moving[self.table.column("paint")[surface.material[moving]]]
        values[painted] = self.paint[surface.instance[painted]]
        if surface.measured is not None:
            values = np.where(np.isnan(surface.measured), values, surface.measured)
        values *= surface.instance != NOTHING
        return values
