"""Gaussian noise of ranges."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import NoiseEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class RangeNoise(NoiseEffect):
    """R + ε, ε ~ N(0, σ²), σ² = σ0² + (σ1·R)²."""

    name: ClassVar = "range_noise"
    phase: ClassVar = Phase.RANGE_NOISE
    channel: ClassVar = "range_variance"
    equation: ClassVar = "R + N(0, σ0² + (σ1·R)²)"
    reference: ClassVar = "Velodyne HDL-64E S2 data sheet (2 cm, one σ); 8 mm measured on KITTI"
    confusable_with: ClassVar = (
        "beam_divergence",
        "range_quantization",
        "foliage_depth",
        "surface_relief",
        "intensity_noise",
        "range_tail",
    )
    example: ClassVar = {"sigma_m": 0.1, "sigma_per_m": 0.0}
    neutral: ClassVar = {"sigma_m": 0.0, "sigma_per_m": 0.0}
    shapes: ClassVar = ({}, {"sigma_per_m": 0.001})

    sigma_m: float = number("σ0, standard deviation at range 0", unit="m", ge=0, le=2)
    sigma_per_m: float = number("σ1, growth with range", unit="m/m", ge=0, le=0.1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Scattered ranges, never below zero."""
        sigma, _ = self.spread(returns, shot)
        noise = shot.per_return(returns, rng.standard_normal((2, len(shot.rays)), np.float32))
        return replace(returns, range_m=np.maximum(returns.range_m + sigma * noise, np.float32(0)))

    def spread(self, returns: Returns, shot: Shot) -> tuple[np.ndarray, float]:
        """Return σ by range, and 0 for intensity."""
        return np.hypot(np.float32(self.sigma_m), np.float32(self.sigma_per_m) * returns.range_m), 0.0
