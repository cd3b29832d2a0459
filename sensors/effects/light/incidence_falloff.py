"""Received power decreases with the incidence angle."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class IncidenceFalloff(EchoEffect):
    """I·cosⁿθ, θ between the true beam and the surface's normal; n = 1 is Lambert's law."""

    name: ClassVar = "incidence_falloff"
    phase: ClassVar = Phase.INCIDENCE
    channel: ClassVar = "intensity"
    equation: ClassVar = "I·cosⁿθ"
    reference: ClassVar = "Kashani et al.: A review of LiDAR radiometric processing, Sensors 2015"
    taxonomy: ClassVar = "sp51"
    confusable_with: ClassVar = (
        "incidence_bias",
        "range_falloff",
        "paint_gloss",
        "wet_road",
        "projected_intensity",
        "ring_gain",
        "detector_compression",
    )
    example: ClassVar = {"exponent": 1.0}
    neutral: ClassVar = {"exponent": 0.0}

    exponent: float = number("n", ge=0, le=20)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns attenuated by incidence."""
        cos = shot.cos_incidence(returns)
        return replace(returns, intensity=returns.intensity * cos ** np.float32(self.exponent))
