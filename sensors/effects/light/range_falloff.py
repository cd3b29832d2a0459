"""Received power decreases with range."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class RangeFalloff(EchoEffect):
    """I·(1 + R/R0)^−p: the remainder of 1/R² after defocusing at short range and the sensor's own compensation."""

    name: ClassVar = "range_falloff"
    phase: ClassVar = Phase.RANGE_FALLOFF
    channel: ClassVar = "intensity"
    equation: ClassVar = "I·(1 + R/R0)^−p"
    reference: ClassVar = "Höfle, Pfeifer: Correction of laser scanning intensity data, ISPRS J. 2007"
    taxonomy: ClassVar = "sp39"
    confusable_with: ClassVar = (
        "atmospheric_extinction",
        "focal_response",
        "incidence_falloff",
        "receiver_focus",
        "linear_falloff",
        "ring_gain",
        "detector_compression",
        "intensity_floor",
    )
    example: ClassVar = {"reference_m": 30.0, "exponent": 2.0}
    neutral: ClassVar = {"reference_m": 30.0, "exponent": 0.0}
    shapes: ClassVar = ({"reference_m": 5.0}, {"reference_m": 15.0}, {"reference_m": 50.0}, {"reference_m": 150.0})

    reference_m: float = number("R0", unit="m", ge=0.1, le=10000)
    exponent: float = number("p", ge=0, le=10)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Weaker returns from afar."""
        falloff = (1 + returns.range_m / np.float32(self.reference_m)) ** np.float32(-self.exponent)
        return replace(returns, intensity=returns.intensity * falloff)
