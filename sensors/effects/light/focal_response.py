"""Focus of the HDL-64E's receivers, and its compensation."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class FocalResponse(EchoEffect):
    """I + slope/255·|256(1 − f/13100)² − 256(1 − d/65535)²|, f in centimetres, d in units of 2 mm."""

    name: ClassVar = "focal_response"
    phase: ClassVar = Phase.FOCAL_RESPONSE
    channel: ClassVar = "intensity"
    equation: ClassVar = "I + slope/255·|256(1 − f/13100)² − 256(1 − d/65535)²|"
    reference: ClassVar = "Velodyne HDL-64E S2 user's manual, Appendix: intensity compensation"
    confusable_with: ClassVar = ("range_falloff", "atmospheric_extinction", "receiver_focus")
    example: ClassVar = {"focal_distance_m": 12.0, "slope": 1.3}
    neutral: ClassVar = {"focal_distance_m": 12.0, "slope": 0.0}
    shapes: ClassVar = tuple({"focal_distance_m": focus} for focus in (2.0, 7.0, 12.0, 20.0, 40.0))

    focal_distance_m: float = number("distance of sharpest focus", unit="m", ge=0, le=131)
    slope: float = number("strength of the compensation", ge=-10, le=10)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with the sensor's own compensation."""
        focus = 256 * (1 - 100 * self.focal_distance_m / 13100) ** 2
        away = np.abs(focus - 256 * (1 - returns.range_m / np.float32(0.002 * 65535)) ** 2)
        return replace(returns, intensity=returns.intensity + np.float32(self.slope / 255) * away.astype(np.float32))
