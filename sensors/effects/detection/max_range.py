"""Maximum range that depends on reflectance."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class MaxRange(EchoEffect):
    """Kept while R ≤ range·√(ρ/0.1), ρ the bare reflectance: data sheets state the range on a target of 10 %."""

    name: ClassVar = "max_range"
    phase: ClassVar = Phase.MAX_RANGE
    channel: ClassVar = "drop"
    equation: ClassVar = "kept while R ≤ range·√(ρ/0.1)"
    reference: ClassVar = "Velodyne and Ouster data sheets; signal ∝ ρ/R² for targets wider than the beam"
    taxonomy: ClassVar = "re1"
    confusable_with: ClassVar = ("detection_threshold", "atmospheric_extinction", "pulse_detection")
    example: ClassVar = {"range_m": 30.0}
    neutral: ClassVar = {"range_m": 1000.0}
    shapes: ClassVar = tuple({"range_m": range_m} for range_m in (20.0, 35.0, 50.0, 70.0, 100.0))

    range_m: float = number("range on a target of 10 % reflectance", unit="m", ge=1, le=1000)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns within the maximum range."""
        return returns.take(
            returns.range_m <= np.float32(self.range_m) * np.sqrt(returns.reflectance / np.float32(0.1))
        )
