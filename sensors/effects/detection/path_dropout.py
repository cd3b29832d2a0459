"""Losses that increase with range."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import DetectionEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class PathDropout(DetectionEffect):
    """Kept with probability exp(−R/L): on every metre of air the pulse is blocked with the same probability.

    Twigs, insects, exhaust and air turbulence block pulses to bright and dark surfaces equally. From 5 to 50 m the
    share of firings missing within one surface in KITTI's scans is proportional to range.
    """

    name: ClassVar = "path_dropout"
    phase: ClassVar = Phase.DROPOUT
    channel: ClassVar = "drop"
    equation: ClassVar = "P(kept) = exp(−R/L)"
    reference: ClassVar = "Beer–Lambert law for random obstacles; lost firings of KITTI's scans"
    taxonomy: ClassVar = "di1"
    confusable_with: ClassVar = (
        "random_dropout",
        "detection_threshold",
        "pulse_detection",
        "foliage_loss",
        "laser_dropout",
    )
    example: ClassVar = {"mean_path_m": 40.0}
    is_candidate: ClassVar = False

    mean_path_m: float = number("L, the way after which 1/e of the pulses are left", unit="m", ge=1, le=1e6)

    def kept(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability (m,) of each return, decreasing with range."""
        return np.exp(-returns.range_m.astype(np.float64) / self.mean_path_m)
