"""Range walk: weak echoes cross the detection threshold later."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import PointEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class RangeWalk(PointEffect):
    """R + a·e^(−k·I), I after radiometry, before noise and rounding, 0–1."""

    name: ClassVar = "range_walk"
    phase: ClassVar = Phase.RANGE_WALK
    channel: ClassVar = "range"
    equation: ClassVar = "R + a·exp(−k·I)"
    reference: ClassVar = "Palojärvi et al.: A receiver channel with leading edge discriminator, IEEE JSSC 2005"
    confusable_with: ClassVar = ("incidence_bias", "range_bias")
    example: ClassVar = {"amplitude_m": 0.2, "decay": 5.0}
    neutral: ClassVar = {"amplitude_m": 0.0, "decay": 5.0}
    shapes: ClassVar = ({"decay": 1.0}, {"decay": 3.0}, {"decay": 8.0}, {"decay": 20.0})

    amplitude_m: float = number("a, delay of the weakest echo", unit="m", ge=-2, le=2)
    decay: float = number("k, how fast it fades with intensity", ge=0, le=1000)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with ranges increased for weak echoes."""
        delay = np.float32(self.amplitude_m) * np.exp(np.float32(-self.decay) * returns.intensity)
        return replace(returns, range_m=returns.range_m + delay)
