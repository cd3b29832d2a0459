"""Compressive response of detectors and amplifiers."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class DetectorCompression(EchoEffect):
    """I → c·(I/c)^γ: with γ < 1 intensities above the pivot c are reduced, those below it are raised."""

    name: ClassVar = "detector_compression"
    phase: ClassVar = Phase.COMPRESSION
    channel: ClassVar = "intensity"
    equation: ClassVar = "c·(I/c)^γ"
    reference: ClassVar = "Höfle, Pfeifer: Correction of laser scanning intensity data, ISPRS J. 2007, section 3"
    taxonomy: ClassVar = "re18"
    confusable_with: ClassVar = ("range_falloff", "incidence_falloff")
    example: ClassVar = {"gamma": 0.5, "pivot": 0.3}
    neutral: ClassVar = {"gamma": 1.0, "pivot": 0.3}
    is_candidate: ClassVar = False

    gamma: float = number("γ, 1 for a linear detector", ge=0.1, le=3)
    pivot: float = number("c, the intensity that is not changed", ge=0.01, le=1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with compressed intensities."""
        pivot = np.float32(self.pivot)
        level = pivot * (np.maximum(returns.intensity, 0) / pivot) ** np.float32(self.gamma)
        return replace(returns, intensity=level)
