"""Ranges are counted in steps."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import RoundingEffect, number
from sensors.returns import Returns
from sensors.shot import Shot


class RangeQuantization(RoundingEffect):
    """R rounded to the nearest step; the HDL-64E's is 2 mm."""

    name: ClassVar = "range_quantization"
    channel: ClassVar = "range"
    equation: ClassVar = "step·round(R/step)"
    reference: ClassVar = "Velodyne HDL-64E S2 user's manual (2 mm)"
    confusable_with: ClassVar = ("range_noise",)
    example: ClassVar = {"step_m": 0.5}
    neutral: ClassVar = None

    step_m: float = number("step", unit="m", ge=0.0001, le=1)

    @property
    def steps(self) -> tuple[float, float]:
        """The range's alone."""
        return self.step_m, 0.0

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Rounded ranges."""
        steps = np.rint(returns.range_m / self.step_m)
        return replace(returns, range_m=(steps * self.step_m).astype(np.float32))
