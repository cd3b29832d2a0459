"""Detection depends on the received power, not on the gain of the reported intensity."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import DetectionEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class PulseDetection(DetectionEffect):
    """Kept with probability 1/(1 + (S0/S)^k), S being the signal before the lasers' gains and the compression.

    `detection_threshold` depends on the reported intensity instead, so that lasers with low gain miss more. In KITTI's
    scans they do not: the share of lost firings of a laser barely depends on its gain, even beyond 60 m (correlation
    −0.2). Retro-reflectors are always noticed.
    """

    name: ClassVar = "pulse_detection"
    phase: ClassVar = Phase.DETECTION
    channel: ClassVar = "drop"
    equation: ClassVar = "P(kept) = 1/(1 + (S0/S)^k)"
    reference: ClassVar = (
        "Richmond, Cain: Direct-Detection LADAR Systems, SPIE 2010, ch. 3; lost firings of KITTI's scans"
    )
    taxonomy: ClassVar = "di3"
    confusable_with: ClassVar = ("detection_threshold", "random_dropout", "max_range", "weak_signal", "path_dropout")
    example: ClassVar = {"signal": 0.2, "steepness": 4.0}
    neutral: ClassVar = {"signal": 0.0, "steepness": 3.0}
    is_candidate: ClassVar = False

    signal: float = number("S0, signal that is noticed every other time", ge=0, le=1)
    steepness: float = number("k, how quickly the chance rises with the signal", ge=0.1, le=50)

    def kept(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability (m,) of each return, increasing with the received power."""
        weakness = self.signal / np.maximum(returns.intensity.astype(np.float64), 1e-12)
        return np.where(shot.is_material("retro", returns), 1.0, 1 / (1 + weakness**self.steepness))
