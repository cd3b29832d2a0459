"""Quantised ranges."""

from __future__ import annotations

from typing import ClassVar

from sensors.effects.base import RoundingEffect, number


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
        """Return the step of ranges, and 0 for intensities."""
        return self.step_m, 0.0
