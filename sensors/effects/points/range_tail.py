"""Range noise with heavy tails."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import NoiseEffect, bounded, laser_factors, number, of_lasers
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class RangeTail(NoiseEffect):
    """R + σ·f·t·√((ν − 2)/ν), t of Student's distribution with ν degrees of freedom: heavy tails around σ·f.

    On smooth road of KITTI's scans differences of range between neighbours have a 90 % quantile of 2.8 times their
    median; normal noise has 2.4 times. Lasers differ by the factors f: the noisiest scatter twice as much as the best.
    """

    name: ClassVar = "range_tail"
    phase: ClassVar = Phase.RANGE_NOISE
    channel: ClassVar = "range_variance"
    equation: ClassVar = "R + σ·f[ring]·t(ν)·√((ν − 2)/ν)"
    reference: ClassVar = "Lange, Little, Taylor: Robust statistical modeling using the t distribution, JASA 1989"
    confusable_with: ClassVar = ("range_noise",)
    example: ClassVar = {"sigma_m": 0.05, "degrees": 4.0, "factors": (1.0, 0.5) * 32}
    is_candidate: ClassVar = False

    sigma_m: float = number("σ, standard deviation", unit="m", ge=0, le=2)
    degrees: float = number("ν, degrees of freedom: the fewer, the heavier the tails", ge=2.1, le=100)
    factors: bounded(0, 20) = laser_factors()  # type: ignore[valid-type]

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Scattered ranges, never below zero."""
        sigma, _ = self.spread(returns, shot)
        noise = shot.per_return(returns, rng.standard_t(self.degrees, (2, len(shot.rays))))
        range_m = returns.range_m + (np.sqrt((self.degrees - 2) / self.degrees) * sigma * noise).astype(np.float32)
        return replace(returns, range_m=np.maximum(range_m, np.float32(0)))

    def spread(self, returns: Returns, shot: Shot) -> tuple[np.ndarray | float, float]:
        """Return σ·f of range, and 0 for intensity."""
        return self.sigma_m * of_lasers(self.factors, returns, shot), 0.0
