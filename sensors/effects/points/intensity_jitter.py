"""Additive noise of intensities, independent of brightness."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import NoiseEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class IntensityJitter(NoiseEffect):
    """I + ε, ε ~ N(0, σ²): the amplifier's own noise, which is there without a signal too."""

    name: ClassVar = "intensity_jitter"
    phase: ClassVar = Phase.INTENSITY_JITTER
    channel: ClassVar = "intensity_variance"
    equation: ClassVar = "I + N(0, σ²)"
    reference: ClassVar = "Synth It Like KITTI, arXiv:2502.15076, published code: σ = 0.02"
    confusable_with: ClassVar = (
        "intensity_noise",
        "intensity_quantization",
        "reflectance_field",
        "surface_grain",
        "firing_noise",
    )
    example: ClassVar = {"sigma": 0.02}
    neutral: ClassVar = {"sigma": 0.0}
    is_candidate: ClassVar = False

    sigma: float = number("σ, standard deviation of the reported intensity", ge=0, le=0.5)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with noisy intensities; below zero if noise exceeds the signal."""
        noise = shot.per_return(returns, rng.standard_normal((2, len(shot.rays)), np.float32))
        return replace(returns, intensity=returns.intensity + np.float32(self.sigma) * noise)

    def spread(self, returns: Returns, shot: Shot) -> tuple[float, float]:
        """Return 0 for range, and σ of intensity."""
        return 0.0, self.sigma
