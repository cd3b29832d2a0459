"""Droplets of fog and rain return echoes before the target does."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import ScanEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot

_INTENSITY = 0.02
_BEHIND_M = 1.0  # possible range error of a twin's surface


class Backscatter(ScanEffect):
    """Per beam and metre, hazard density·e^(−r/mean_range) from the nearest measurable range on; the nearest echo wins.

    Beams that hit nothing may return, too. Intensity is 0.02 ± 20 %.
    """

    name: ClassVar = "backscatter"
    phase: ClassVar = Phase.BACKSCATTER
    channel: ClassVar = "spurious"
    also: ClassVar = ("drop", "range", "intensity")
    equation: ClassVar = "h(r) = density·exp(−r/mean_range)"
    reference: ClassVar = "Goodin et al.: Predicting the influence of rain on LIDAR in ADAS, Electronics 2019"
    taxonomy: ClassVar = "sp22"
    confusable_with: ClassVar = ("false_alarms",)
    repeatable: ClassVar = True
    example: ClassVar = {"density_per_m": 0.02, "mean_range_m": 6.0}
    neutral: ClassVar = {"density_per_m": 0.0, "mean_range_m": 6.0}
    shapes: ClassVar = tuple({"mean_range_m": reach} for reach in (3.0, 8.0, 20.0, 60.0))

    density_per_m: float = number("chance of an echo per metre, at range 0", unit="1/m", ge=0, le=10)
    mean_range_m: float = number("how far drops are seen", unit="m", ge=0.1, le=1000)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns, some of them replaced by droplets in front."""
        beams = len(shot.rays)
        hazard, brightness = rng.exponential(size=beams), rng.normal(1, 0.2, beams).clip(0, 2)
        near, far = shot.pattern.range_m
        # ∫ h dr from `near` to r equals a unit exponential at the first echo.
        total = self.density_per_m * self.mean_range_m
        left = np.exp(-near / self.mean_range_m) - hazard / max(total, 1e-12)
        echo = np.where(left > 0, -self.mean_range_m * np.log(np.maximum(left, 1e-300)), np.inf)
        nearest = np.full(beams, far, np.float32)
        np.minimum.at(nearest, returns.beam, returns.range_m)
        beam = np.flatnonzero(echo < nearest)
        return returns.replacing_beams(Returns.spurious(beam, echo[beam], _INTENSITY * brightness[beam]))

    def survival(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability (m,) of no droplet before the surface."""
        return np.exp(-self._hazard_up_to(returns.range_m, shot))

    def silence(self, shot: Shot) -> np.ndarray:
        """Return the probability (n,) of no droplet along the whole beam."""
        return np.exp(-self._hazard_up_to(self._free_path(shot), shot))

    def density(self, beam: np.ndarray, range_m: np.ndarray, shot: Shot) -> np.ndarray:
        """Return the hazard at the range times the probability to reach it; 0 behind the surface."""
        hazard = self.density_per_m * np.exp(-range_m / self.mean_range_m)
        possible = (range_m >= shot.pattern.range_m[0]) & (range_m <= self._free_path(shot)[beam] + _BEHIND_M)
        return hazard * np.exp(-self._hazard_up_to(range_m, shot)) * possible

    @staticmethod
    def _free_path(shot: Shot) -> np.ndarray:
        """Free path of each beam [m]."""
        return np.minimum(shot.hits.solid.range_m, np.float32(shot.pattern.range_m[1]))

    def _hazard_up_to(self, range_m: np.ndarray, shot: Shot) -> np.ndarray:
        near = np.exp(-shot.pattern.range_m[0] / self.mean_range_m)
        return self.density_per_m * self.mean_range_m * np.maximum(near - np.exp(-range_m / self.mean_range_m), 0)
