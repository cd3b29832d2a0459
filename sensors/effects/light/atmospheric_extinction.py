"""Air, fog and rain attenuate the beam in both directions."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot

_LOST_BELOW = 0.005


class AtmosphericExtinction(EchoEffect):
    """I·e^(−2αR); returns below 0.005 are lost."""

    name: ClassVar = "atmospheric_extinction"
    phase: ClassVar = Phase.EXTINCTION
    channel: ClassVar = "intensity"
    also: ClassVar = ("drop",)
    equation: ClassVar = "I·exp(−2αR), lost below 0.005"
    reference: ClassVar = "Rasshofer et al.: Influences of weather on automotive laser radar, Adv. Radio Sci. 2011"
    taxonomy: ClassVar = "sp18"
    confusable_with: ClassVar = (
        "range_falloff",
        "focal_response",
        "detection_threshold",
        "wet_road",
        "receiver_focus",
        "linear_falloff",
        "max_range",
    )
    example: ClassVar = {"alpha_per_m": 0.02}
    neutral: ClassVar = {"alpha_per_m": 0.0}

    alpha_per_m: float = number("α, extinction coefficient", unit="1/m", ge=0, le=1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns attenuated with range; the weakest are lost."""
        intensity = returns.intensity * np.exp(np.float32(-2 * self.alpha_per_m) * returns.range_m)
        return replace(returns, intensity=intensity).take(intensity >= _LOST_BELOW)
