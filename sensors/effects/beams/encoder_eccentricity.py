"""Eccentric encoder disc."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, number
from sensors.effects.phases import Phase
from sensors.shot import Shot


class EncoderEccentricity(BeamEffect):
    """True azimuth = reported + A·sin(az + φ), az the reported beam azimuth, counter-clockwise."""

    name: ClassVar = "encoder_eccentricity"
    phase: ClassVar = Phase.AZIMUTH
    channel: ClassVar = "range"
    equation: ClassVar = "az_true = az + A·sin(az + φ)"
    reference: ClassVar = "Muhammad, Lacroix: Calibration of a rotating multi-beam lidar, IROS 2010"
    confusable_with: ClassVar = ("mount_rotation", "mount_translation", "sweep_motion", "time_offset")
    example: ClassVar = {"amplitude_deg": 1.0, "phase_deg": 0.0}
    neutral: ClassVar = {"amplitude_deg": 0.0, "phase_deg": 0.0}
    shapes: ClassVar = tuple({"phase_deg": phase} for phase in (0.0, 90.0, 180.0, 270.0))

    amplitude_deg: float = number("A, greatest azimuth error", unit="°", ge=0, le=5)
    phase_deg: float = number("φ, where on the circle the error vanishes", unit="°", ge=-360, le=360)

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return the beams turned about the sensor's axis."""
        azimuth = beams.rays.azimuth.astype(np.float64)
        return beams.turned(np.radians(self.amplitude_deg) * np.sin(azimuth + np.radians(self.phase_deg)))
