"""False returns from sunlight and other sensors' pulses."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import ScanEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class FalseAlarms(ScanEffect):
    """A Poisson number of beams of an azimuth sector (sensor axes) returns from a uniform range.

    Each replaces its beam's return; intensity is uniform in 0–0.1.
    """

    name: ClassVar = "false_alarms"
    phase: ClassVar = Phase.FALSE_ALARMS
    channel: ClassVar = "spurious"
    also: ClassVar = ("drop", "range", "intensity")
    equation: ClassVar = "N ~ Poisson(rate), azimuth ~ U(azimuth ± width/2), R ~ U(range_m)"
    reference: ClassVar = "Richmond, Cain: Direct-Detection LADAR Systems, SPIE 2010, ch. 3"
    taxonomy: ClassVar = "sp17"
    confusable_with: ClassVar = ("backscatter", "mirror_ghost")
    repeatable: ClassVar = True
    example: ClassVar = {"rate_per_frame": 400.0, "azimuth_deg": 30.0, "width_deg": 40.0}
    neutral: ClassVar = {"rate_per_frame": 0.0, "azimuth_deg": 0.0, "width_deg": 360.0}
    shapes: ClassVar = (
        *({"azimuth_deg": 20.0 * k, "width_deg": 60.0} for k in range(18)),
        {"width_deg": 360.0},
    )

    rate_per_frame: float = number("mean number of false points in a revolution", ge=0, le=100000)
    azimuth_deg: float = number("middle of the sector, counter-clockwise from forward", unit="°", ge=-360, le=360)
    width_deg: float = number("width of the sector", unit="°", ge=0, le=360)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns, some of them replaced by false ones."""
        sector = np.flatnonzero(self._in_sector(shot.rays.azimuth))
        count = min(int(rng.poisson(self.rate_per_frame)), len(sector))
        beam = np.sort(rng.choice(sector, count, replace=False)) if count else sector[:0]
        false = Returns.spurious(beam, rng.uniform(*shot.pattern.range_m, count), rng.uniform(0, 0.1, count))
        return returns.replacing_beams(false)

    def survival(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability that a beam has no false return."""
        return 1 - self._share(returns.beam, shot)

    def silence(self, shot: Shot) -> np.ndarray:
        """(n,) probability of no return, equal for all beams of the sector."""
        return 1 - self._share(np.arange(len(shot.rays)), shot)

    def density(self, beam: np.ndarray, range_m: np.ndarray, shot: Shot) -> np.ndarray:
        """Return a density that is uniform over the measurable ranges."""
        near, far = shot.pattern.range_m
        return self._share(beam, shot) / (far - near)

    def _share(self, beam: np.ndarray, shot: Shot) -> np.ndarray:
        sector = max(shot.pattern.firings * shot.pattern.rings * min(self.width_deg, 360) / 360, 1)
        return self._in_sector(shot.rays.azimuth[beam]) * min(self.rate_per_frame / sector, 1)

    def _in_sector(self, azimuth_rad: np.ndarray) -> np.ndarray:
        away = np.angle(np.exp(1j * (azimuth_rad.astype(np.float64) - np.radians(self.azimuth_deg))))
        return np.abs(away) <= np.radians(self.width_deg / 2) + 1e-12
