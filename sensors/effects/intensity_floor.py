"""The detector subtracts its noise floor: weak returns are reported with intensity zero."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import PointEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class IntensityFloor(PointEffect):
    """I → max(I − floor, 0)/(1 − floor). The range is still reported: KITTI holds 13.6 % of points with intensity 0."""

    name: ClassVar = "intensity_floor"
    phase: ClassVar = Phase.DETECTOR_FLOOR
    channel: ClassVar = "intensity"
    equation: ClassVar = "max(I − floor, 0)/(1 − floor)"
    reference: ClassVar = "Velodyne HDL-64E S2 calibration, minIntensity; share of zeros measured on KITTI"
    confusable_with: ClassVar = ("range_falloff", "intensity_quantization")
    example: ClassVar = {"floor": 0.1}
    neutral: ClassVar = {"floor": 0.0}
    is_candidate: ClassVar = False

    floor: float = number("signal that is reported as zero", ge=0, le=0.9)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Returns less the floor."""
        above = np.maximum(returns.intensity - np.float32(self.floor), 0) / np.float32(1 - self.floor)
        return replace(returns, intensity=above)
