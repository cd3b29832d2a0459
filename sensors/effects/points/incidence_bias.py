"""Range bias that depends on the incidence angle, because inclined surfaces stretch the pulse."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import PointEffect, number
from sensors.effects.phases import Phase
from sensors.hits import NOTHING
from sensors.returns import Returns
from sensors.shot import Shot


class IncidenceBias(PointEffect):
    """R + g·min(tan θ, 10)."""

    name: ClassVar = "incidence_bias"
    phase: ClassVar = Phase.INCIDENCE_BIAS
    channel: ClassVar = "range"
    equation: ClassVar = "R + g·min(tan θ, 10)"
    reference: ClassVar = "Soudarissanane et al.: Scanning geometry, ISPRS J. 2011"
    taxonomy: ClassVar = "sp45"
    confusable_with: ClassVar = ("range_walk", "beam_divergence", "incidence_falloff")
    example: ClassVar = {"gain_m": 0.05}
    neutral: ClassVar = {"gain_m": 0.0}

    gain_m: float = number("g, range error at 45°", unit="m", ge=-1, le=1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with ranges biased by incidence."""
        cos = np.maximum(shot.cos_incidence(returns), np.float32(1e-6))
        tangent = np.minimum(np.sqrt(np.maximum(1 - cos * cos, 0)) / cos, 10)
        surface = returns.instance != NOTHING
        return replace(
            returns, range_m=returns.range_m + np.float32(self.gain_m) * np.where(surface, tangent, np.float32(0))
        )
