"""Noise of reported intensities that is negatively correlated between consecutive firings."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import NoiseEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class FiringNoise(NoiseEffect):
    """I + σ·(ε_k − θ·ε_{k−1})/√(1 + θ²) for firing k of a laser, not below `least`; what is zero stays zero.

    A moving average with a negative second coefficient: in KITTI's scans intensities two firings apart are more similar
    than neighbours (correlation on road 0.80 and 0.76, elsewhere 0.67 and 0.51), as a power control that depends on
    the last echo causes. Reported values start at about 0.04, except zeros.
    """

    name: ClassVar = "firing_noise"
    phase: ClassVar = Phase.INTENSITY_JITTER
    channel: ClassVar = "intensity_variance"
    equation: ClassVar = "max(I + σ(ε_k − θ·ε_{k−1})/√(1 + θ²), least) where I > 0, ε ~ N(0, 1)"
    reference: ClassVar = "Box, Jenkins: Time Series Analysis, 1976, MA(1); intensities along rings of KITTI's scans"
    confusable_with: ClassVar = ("intensity_jitter", "intensity_noise")
    example: ClassVar = {"sigma": 0.04, "theta": 0.6, "least": 0.03}
    is_candidate: ClassVar = False

    sigma: float = number("σ, standard deviation of the reported intensity", ge=0, le=0.5)
    theta: float = number("θ, share of the last firing's noise that is taken back", ge=0, le=1)
    least: float = number("least intensity that is reported, zeros apart", ge=0, le=0.5)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with noisy intensities."""
        draw = rng.standard_normal((2, len(shot.rays)), np.float32)
        draw[:, 1:] -= np.float32(self.theta) * draw[:, :-1].copy()
        noise = shot.per_return(returns, draw) * np.float32(self.sigma / np.sqrt(1 + self.theta**2))
        scattered = np.maximum(returns.intensity + noise, np.float32(self.least))
        return replace(returns, intensity=np.where(returns.intensity > 0, scattered, returns.intensity))

    def spread(self, returns: Returns, shot: Shot) -> tuple[float, np.ndarray]:
        """Return 0 for range, and σ of intensities that are not zero."""
        return 0.0, np.where(returns.intensity > 0, self.sigma, 0.0)
