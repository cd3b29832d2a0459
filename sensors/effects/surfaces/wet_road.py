"""A film of water darkens the road and reflects beams at grazing incidence specularly."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.effects.surfaces.reflection import mirrored_returns
from sensors.returns import Returns
from sensors.shot import Shot

_WATER_INDEX = 1.33
_PATH_M = 60.0


class WetRoad(EchoEffect):
    """Road materials return I·(1 − film/2); a share film·F(θ) of beams is reflected forward.

    F is Fresnel's reflectance of water after Schlick, F0 + (1 − F0)(1 − cos θ)⁵, F0 = ((n − 1)/(n + 1))², n = 1.33.
    A reflected beam is lost unless it hits a surface within 60 m of the road: then it returns from below ground.
    """

    name: ClassVar = "wet_road"
    phase: ClassVar = Phase.WET_ROAD
    channel: ClassVar = "drop"
    also: ClassVar = ("intensity", "spurious", "range")
    equation: ClassVar = "I·(1 − film/2);  P(mirrored) = film·(F0 + (1 − F0)(1 − cos θ)⁵) on roads"
    reference: ClassVar = "Schlick: An inexpensive BRDF model for physically-based rendering, Eurographics 1994"
    taxonomy: ClassVar = "sp67"
    confusable_with: ClassVar = ("detection_threshold", "atmospheric_extinction", "incidence_falloff")
    needs_new_rays: ClassVar = True
    example: ClassVar = {"film": 0.8}
    neutral: ClassVar = {"film": 0.0}

    film: float = number("0 dry, 1 a closed film of water", ge=0, le=1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return darker roads without lost returns, and a few returns below ground."""
        returns, kept = self.expected(returns, shot)
        mirrored = rng.random(len(shot.rays))[returns.beam] >= kept
        ghosts, _ = mirrored_returns(returns.take(mirrored), shot, _PATH_M)
        return returns.take(~mirrored).merged(ghosts)

    def expected(self, returns: Returns, shot: Shot) -> tuple[Returns, np.ndarray]:
        """Return darker roads, and the share (m,) of their beams that is not reflected."""
        road = shot.is_material("road", returns)
        dark = np.where(road, returns.intensity * np.float32(1 - self.film / 2), returns.intensity)
        f0 = ((_WATER_INDEX - 1) / (_WATER_INDEX + 1)) ** 2
        fresnel = f0 + (1 - f0) * (1 - shot.cos_incidence(returns)) ** 5
        return replace(returns, intensity=dark), 1 - road * self.film * fresnel
