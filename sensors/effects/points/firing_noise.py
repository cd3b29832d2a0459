"""Noise of reported intensities that is negatively correlated between consecutive firings."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from sensors.effects.base import NoiseEffect, bounded, laser_factors, number, of_lasers
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class FiringNoise(NoiseEffect):
    """I + σ·f·x_k for firing k of a laser with factor f, not below `least`; what is zero stays zero.

    x is an ARMA(1, 1) process of unit variance with negative coefficients, x_k = −φ·x_{k−1} + ε_k − θ·ε_{k−1}: a power
    control that depends on the last echo overshoots. In KITTI's scans the spectrum of intensities along a row of
    smooth surfaces rises from long to short waves, with a line where every other firing is brighter: eight times the
    level of long waves for the upper 32 lasers, five times for the lower ones, whose noise is half as strong.
    Reported values start at about 0.04, except zeros.
    """

    name: ClassVar = "firing_noise"
    phase: ClassVar = Phase.INTENSITY_JITTER
    channel: ClassVar = "intensity_variance"
    equation: ClassVar = (
        "max(I + σ·f[ring]·x_k, least) where I > 0; x_k = −φ·x_{k−1} + s(ε_k − θ·ε_{k−1}), ε ~ N(0, 1), Var x = 1"
    )
    reference: ClassVar = (
        "Box, Jenkins: Time Series Analysis, 1976, ARMA(1, 1); intensities along rings of KITTI's scans"
    )
    confusable_with: ClassVar = ("intensity_jitter", "intensity_noise")
    example: ClassVar = {"sigma": 0.04, "theta": 0.6, "phi": 0.4, "least": 0.03, "factors": (1.0, 0.5) * 32}
    is_candidate: ClassVar = False

    sigma: float = number("σ, standard deviation of the reported intensity", ge=0, le=0.5)
    theta: float = number("θ, share of the last firing's noise that is taken back", ge=0, le=1)
    phi: float = Field(default=0.0, ge=0, le=0.99, description="φ, share of the last deviation that changes sign")
    least: float = number("least intensity that is reported, zeros apart", ge=0, le=0.5)
    factors: bounded(0, 20) = laser_factors()  # type: ignore[valid-type]

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with noisy intensities."""
        from scipy.signal import lfilter

        draw = lfilter([1.0, -self.theta], [1.0, self.phi], rng.standard_normal((2, len(shot.rays)), np.float32))
        draw *= np.sqrt((1 - self.phi**2) / (1 + self.theta**2 + 2 * self.theta * self.phi))
        noise = shot.per_return(returns, draw) * self._sigma(returns, shot)
        scattered = np.maximum(returns.intensity + noise, np.float32(self.least))
        return replace(returns, intensity=np.where(returns.intensity > 0, scattered, returns.intensity))

    def spread(self, returns: Returns, shot: Shot) -> tuple[float, np.ndarray]:
        """Return 0 for range, and σ·f of intensities that are not zero."""
        return 0.0, np.where(returns.intensity > 0, self._sigma(returns, shot), 0.0)

    def _sigma(self, returns: Returns, shot: Shot) -> np.ndarray | float:
        """Standard deviation of each return, (m,) or one for all."""
        return self.sigma * of_lasers(self.factors, returns, shot)
