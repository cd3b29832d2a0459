"""Weak returns are lost: the weaker, the more probably."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import DetectionEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class DetectionThreshold(DetectionEffect):
    """Kept with probability 1/(1 + e^(−(I − threshold)/softness)), I in 0–1."""

    name: ClassVar = "detection_threshold"
    phase: ClassVar = Phase.THRESHOLD
    channel: ClassVar = "drop"
    equation: ClassVar = "P(kept) = 1/(1 + exp(−(I − threshold)/softness))"
    reference: ClassVar = "Richmond, Cain: Direct-Detection LADAR Systems, SPIE 2010, ch. 3"
    taxonomy: ClassVar = "di3"
    confusable_with: ClassVar = (
        "random_dropout",
        "max_range",
        "atmospheric_extinction",
        "wet_road",
        "pulse_detection",
        "path_dropout",
        "intensity_cutoff",
    )
    example: ClassVar = {"threshold": 0.2, "softness": 0.02}
    neutral: ClassVar = {"threshold": 0.0, "softness": 0.0001}
    shapes: ClassVar = tuple(
        {"threshold": threshold, "softness": softness}
        for threshold in (0.03, 0.05, 0.08, 0.12, 0.18, 0.3)
        for softness in (threshold / 8, threshold / 3)
    )

    threshold: float = number("intensity that is kept every other time", ge=0, le=1)
    softness: float = number("width of the change from lost to kept", ge=0.0001, le=1)

    def kept(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability (m,) of each return."""
        excess = (returns.intensity - self.threshold) / self.softness
        return 1 / (1 + np.exp(-np.clip(excess, -50, 50)))
