"""The detector subtracts its noise floor: weak returns are reported with intensity zero."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from sensors.effects.base import PointEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


def _optional(description: str, *, le: float) -> Any:
    return Field(default=0.0, description=description, ge=0, le=le, json_schema_extra={"unit": ""})


class IntensityFloor(PointEffect):
    """I → max(I − floor, 0)/(1 − floor), and what is then below the least signal is reported as zero.

    The change at the least signal is soft where `softness` is not 0: zero with probability
    1/(1 + e^((I − least)/softness)). The range is still reported: KITTI holds 13.6 % of points with intensity 0 and
    few between 0.01 and 0.1.
    """

    name: ClassVar = "intensity_floor"
    phase: ClassVar = Phase.DETECTOR_FLOOR
    channel: ClassVar = "intensity"
    equation: ClassVar = "I' = max(I − floor, 0)/(1 − floor); P(zero) = 1/(1 + exp((I' − least)/softness))"
    reference: ClassVar = "Velodyne HDL-64E S2 calibration, minIntensity; share of zeros measured on KITTI"
    taxonomy: ClassVar = "pp1"
    confusable_with: ClassVar = ("range_falloff", "intensity_quantization", "weak_signal", "intensity_cutoff")
    example: ClassVar = {"floor": 0.1, "least": 0.1, "softness": 0.02}
    neutral: ClassVar = {"floor": 0.0, "least": 0.0, "softness": 0.0}
    is_candidate: ClassVar = False

    floor: float = number("signal that is subtracted", ge=0, le=0.9)
    least: float = _optional("signal above the floor that is reported every other time", le=1)
    softness: float = _optional("width of the change from zero to reported", le=1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns without the noise floor, the weakest with intensity zero."""
        above = np.maximum(returns.intensity - np.float32(self.floor), 0) / np.float32(1 - self.floor)
        # A logistic draw makes the hard step soft.
        draw = shot.per_return(returns, rng.random((2, len(shot.rays)), np.float32)).astype(np.float64)
        step = self.least + self.softness * np.log(np.maximum(draw, 1e-12) / (1 - draw))
        return replace(returns, intensity=np.where(above >= step, above, 0).astype(np.float32))
