"""Scale error of ranges: the clock of the time-of-flight counter is slow or fast."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import PointEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class RangeScale(PointEffect):
    """R·(1 + s·10⁻⁶)."""

    name: ClassVar = "range_scale"
    phase: ClassVar = Phase.RANGE_SCALE
    channel: ClassVar = "range"
    equation: ClassVar = "R·(1 + s·10⁻⁶)"
    reference: ClassVar = "Glennie, Lichti: Static calibration of the Velodyne HDL-64E S2, Remote Sensing 2010"
    confusable_with: ClassVar = ("range_bias",)
    example: ClassVar = {"scale_ppm": 5000.0}
    neutral: ClassVar = {"scale_ppm": 0.0}

    scale_ppm: float = number("s", unit="ppm", ge=-50000, le=50000)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with scaled ranges."""
        return replace(returns, range_m=returns.range_m * np.float32(1 + self.scale_ppm * 1e-6))
