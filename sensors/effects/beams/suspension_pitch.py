"""The vehicle pitches up when it accelerates and down when it brakes."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, number
from sensors.effects.beams.mount_rotation import about
from sensors.effects.phases import Phase
from sensors.shot import Shot


class SuspensionPitch(BeamEffect):
    """The body turns about the ego origin by pitch = −gain·a_forward (pitch > 0: nose down)."""

    name: ClassVar = "suspension_pitch"
    phase: ClassVar = Phase.SUSPENSION
    channel: ClassVar = "pose"
    equation: ClassVar = "pitch = −gain·a_forward"
    reference: ClassVar = "Gillespie: Fundamentals of Vehicle Dynamics, SAE 1992, ch. 3"
    taxonomy: ClassVar = "em9"
    confusable_with: ClassVar = ("mount_rotation", "elevation_offset")
    example: ClassVar = {"gain_deg_per_mps2": 0.5}
    neutral: ClassVar = {"gain_deg_per_mps2": 0.0}

    gain_deg_per_mps2: float = number("pitch per forward acceleration", unit="°/(m/s²)", ge=-5, le=5)

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return the beams of a pitched vehicle."""
        if shot.world is None:
            raise ValueError("suspension_pitch needs the vehicle's acceleration; measure with trace_and_measure")
        pitch = -np.radians(self.gain_deg_per_mps2) * shot.world.ego.forward_acceleration_mps2
        tilt = np.eye(4)
        tilt[:3, :3] = about(1, pitch)
        return replace(beams, body=beams.body @ tilt)
