"""Reflectance varies over a surface, at the same places in every scan."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from sensors.effects.base import EchoEffect, number
from sensors.effects.material_groups import GROUPS, Group, points_on_surface, rows_of_group
from sensors.effects.phases import Phase
from sensors.effects.spatial_noise import field_at
from sensors.returns import Returns
from sensors.shot import Shot


class _Field(EchoEffect):
    """I·exp(σ·h(f(p/c))) on a group of materials, f a Gaussian random field of unit variance fixed to the surface.

    h(f) = f where it is bright and (1 + skew)·f where it is dark: worn and stained patches lie farther from the
    usual reflectance than bright ones.

    Class attributes:
        shift: cells by which the fields of a group's effects differ.
    """

    channel: ClassVar = "intensity"
    equation: ClassVar = "I·exp(σ·h(f(p/c))), h(f) = f for f ≥ 0, (1 + skew)·f for f < 0"
    taxonomy: ClassVar = "sp47"
    confusable_with: ClassVar = ("intensity_noise", "intensity_jitter")
    needs_new_rays: ClassVar = True  # places on moving objects need their poses
    has_texture: ClassVar = True
    repeatable: ClassVar = True
    is_candidate: ClassVar = False
    shift: ClassVar[int] = 0

    surfaces: Group = Field(description="group of materials")
    sigma: float = number("σ, spread of the logarithm of the reflectance", ge=0, le=3)
    skew: float = Field(
        default=0.0, ge=0, le=10, description="how much deeper dark patches are than bright ones bright"
    )
    cell_m: float = number("c, cell of the field; its features are 2 to 128 cells large", unit="m", ge=0.005, le=10)

    @classmethod
    def offset_of(cls, surfaces: Group) -> tuple[int, int, int]:
        """Cells by which the field of a group is shifted."""
        return cls.shift * (1 + GROUPS.index(surfaces)), cls.shift, 0

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Returns scaled by the reflectance at their places."""
        rows = rows_of_group(self.surfaces, returns, shot)
        intensity = returns.intensity.copy()
        intensity[rows] *= np.exp(self.log_factor(points_on_surface(returns.take(rows), shot)))
        return replace(returns, intensity=intensity)

    def log_factor(self, points: np.ndarray) -> np.ndarray:
        """Return the logarithm (n,) float32 of the reflectance at points (n, 3) [m] relative to the usual one."""
        value = field_at(points, self.cell_m, self.offset_of(self.surfaces))
        value += np.float32(self.skew) * np.minimum(value, 0)
        value *= np.float32(self.sigma)
        return value


class ReflectanceField(_Field):
    """I·exp(σ·h(f(p/c))) on a group of materials: patches, seams and wear of roads, soil in grass, stains.

    f is fixed to the ground, to a building or to a moving object. What is noticed depends on it, too.
    """

    name: ClassVar = "reflectance_field"
    phase: ClassVar = Phase.SURFACE
    reference: ClassVar = "Perlin: An image synthesizer, SIGGRAPH 1985; correlation of neighbours in KITTI's scans"
    example: ClassVar = {"surfaces": "road", "sigma": 0.4, "skew": 1.0, "cell_m": 0.5}
    shift: ClassVar = 37


class SurfaceGrain(_Field):
    """I·exp(σ·h(g(p/c))) on a group of materials, after it is decided what is noticed: grain of a few centimetres.

    Finer than the beam it changes what is reported and not whether it is: zeros of KITTI's scans have smooth outlines
    on surfaces whose intensities scatter from beam to beam.
    """

    name: ClassVar = "surface_grain"
    phase: ClassVar = Phase.GRAIN
    reference: ClassVar = "Perlin: An image synthesizer, SIGGRAPH 1985; differences of neighbours in KITTI's scans"
    example: ClassVar = {"surfaces": "road", "sigma": 0.3, "cell_m": 0.03}
    shift: ClassVar = 59
