"""The vehicle and all objects move during a revolution."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, number
from sensors.effects.phases import Phase
from sensors.shot import Shot


class SweepMotion(BeamEffect):
    """A beam of column azimuth az fires at t = −T·az/2π; p(t) = p0 + v·t, R(t) = Rz(ω·t)·R0 for ego and objects.

    Points are not motion-compensated: they are written as if the sensor had stayed at its pose of t = 0.
    """

    name: ClassVar = "sweep_motion"
    phase: ClassVar = Phase.SWEEP
    channel: ClassVar = "pose"
    equation: ClassVar = "t = −T·az/2π;  p(t) = p0 + v·t, R(t) = Rz(ω·t)·R0"
    reference: ClassVar = "Moosmann, Stiller: Velodyne SLAM, IV 2011"
    taxonomy: ClassVar = "sp37"
    confusable_with: ClassVar = ("time_offset", "encoder_eccentricity")
    example: ClassVar = {"sweep_s": 0.1}
    neutral: ClassVar = {"sweep_s": 0.0}

    sweep_s: float = number("T, duration of a revolution", unit="s", ge=0, le=2)

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return beams that are emitted column by column."""
        if self.sweep_s == 0:
            return beams
        firing_s = beams.rays.time_s * np.float32(self.sweep_s / shot.pattern.sweep_s)
        return replace(beams, firing_s=firing_s)
