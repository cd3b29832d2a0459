"""Random losses."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import DetectionEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class RandomDropout(DetectionEffect):
    """Each return is lost with the same probability, independently."""

    name: ClassVar = "random_dropout"
    phase: ClassVar = Phase.DROPOUT
    channel: ClassVar = "drop"
    equation: ClassVar = "P(lost) = probability"
    reference: ClassVar = "Manivasagam et al.: LiDARsim, CVPR 2020, section 4.2"
    taxonomy: ClassVar = "di1"
    confusable_with: ClassVar = (
        "detection_threshold",
        "glass_transmission",
        "pulse_detection",
        "foliage_loss",
        "laser_dropout",
        "own_shadow",
        "own_silhouette",
        "path_dropout",
        "intensity_cutoff",
        "angular_downsampling",
    )
    example: ClassVar = {"probability": 0.2}
    neutral: ClassVar = {"probability": 0.0}

    probability: float = number("share of returns lost", ge=0, le=1)

    def kept(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return one probability for all."""
        return np.full(len(returns), 1 - self.probability)
