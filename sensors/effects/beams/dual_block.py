"""The HDL-64E's two blocks of lasers have different optical centres."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, number
from sensors.effects.phases import Phase
from sensors.shot import Shot


class DualBlock(BeamEffect):
    """Optical centre = (0, 0, upper) for lasers of block 0, (0, 0, lower) for block 1.

    The sensor's calibration knows the centres, so its points lie on the true surfaces.
    """

    name: ClassVar = "dual_block"
    phase: ClassVar = Phase.BLOCKS
    channel: ClassVar = "range"
    equation: ClassVar = "origin_z = upper (block 0), lower (block 1)"
    reference: ClassVar = "Velodyne HDL-64E S2 user's manual, vertOffsetCorrection"
    confusable_with: ClassVar = ("mount_translation", "elevation_offset")
    example: ClassVar = {"upper_m": 0.2, "lower_m": -0.2}
    neutral: ClassVar = {"upper_m": 0.0, "lower_m": 0.0}

    upper_m: float = number("height of the upper block's centre above the sensor's origin", unit="m", ge=-1, le=1)
    lower_m: float = number("height of the lower block's centre above the sensor's origin", unit="m", ge=-1, le=1)

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return beams with two optical centres, which the sensor knows."""
        rise = np.zeros((len(beams.rays), 3), np.float32)
        rise[:, 2] = np.where(shot.block == 0, self.upper_m, self.lower_m)
        rays = replace(beams.rays, origin=beams.rays.origin + rise)
        return replace(beams, rays=rays, origin=beams.origin + rise)
