"""Quantised intensities."""

from __future__ import annotations

from typing import ClassVar

from sensors.effects.base import RoundingEffect, number


class IntensityQuantization(RoundingEffect):
    """I clipped to 0–1, then rounded to the nearest step; KITTI's is 0.01, 8 bit is 1/255."""

    name: ClassVar = "intensity_quantization"
    channel: ClassVar = "intensity"
    equation: ClassVar = "step·round(clip(I, 0, 1)/step)"
    reference: ClassVar = "Geiger et al.: Vision meets robotics, IJRR 2013; steps measured on its files"
    taxonomy: ClassVar = "re17"
    confusable_with: ClassVar = ("intensity_noise", "intensity_floor", "intensity_jitter")
    example: ClassVar = {"step": 0.1}
    neutral: ClassVar = None

    step: float = number("step", ge=0.0001, le=0.5)

    @property
    def steps(self) -> tuple[float, float]:
        """Return the step of intensities, and 0 for ranges."""
        return 0.0, self.step
