"""Noise of intensities in proportion to intensity."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import NoiseEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class IntensityNoise(NoiseEffect):
    """I·(1 + ε), ε ~ N(0, σ²): speckle and gain noise grow with the signal."""

    name: ClassVar = "intensity_noise"
    phase: ClassVar = Phase.INTENSITY_NOISE
    channel: ClassVar = "intensity_variance"
    equation: ClassVar = "I·(1 + N(0, σ²))"
    reference: ClassVar = "Goodman: Statistical Optics, Wiley 2015 (speckle)"
    taxonomy: ClassVar = "sp36"
    confusable_with: ClassVar = (
        "range_noise",
        "reflectance_field",
        "surface_grain",
        "firing_noise",
        "intensity_jitter",
        "intensity_quantization",
    )
    example: ClassVar = {"sigma_rel": 0.3}
    neutral: ClassVar = {"sigma_rel": 0.0}

    sigma_rel: float = number("σ relative to the intensity", ge=0, le=2)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with noisy intensities."""
        noise = shot.per_return(returns, rng.standard_normal((2, len(shot.rays)), np.float32))
        return replace(returns, intensity=returns.intensity * (1 + np.float32(self.sigma_rel) * noise))

    def spread(self, returns: Returns, shot: Shot) -> tuple[float, np.ndarray]:
        """Return 0 for range, and σ in proportion to intensity."""
        return 0.0, np.float32(self.sigma_rel) * returns.intensity
