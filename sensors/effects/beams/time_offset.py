"""Offset between the clocks of poses and scans."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, number
from sensors.effects.phases import Phase
from sensors.shot import Shot


class TimeOffset(BeamEffect):
    """The scan was taken `delay_s` later than its pose: p(delay) = p0 + v·delay."""

    name: ClassVar = "time_offset"
    phase: ClassVar = Phase.TIME
    channel: ClassVar = "pose"
    equation: ClassVar = "t → t + delay for ego and objects"
    reference: ClassVar = "Rehder et al.: A general approach to spatiotemporal calibration, T-RO 2016"
    confusable_with: ClassVar = ("sweep_motion", "mount_translation", "encoder_eccentricity")
    example: ClassVar = {"delay_s": 0.1}
    neutral: ClassVar = {"delay_s": 0.0}

    delay_s: float = number("how much later the scan was taken", unit="s", ge=-1, le=1)

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return beams that are emitted later."""
        return replace(beams, delay_s=beams.delay_s + self.delay_s)
