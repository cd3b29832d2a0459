"""Translation of the whole sensor in its mount."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, number
from sensors.effects.phases import Phase
from sensors.shot import Shot


class MountTranslation(BeamEffect):
    """True LiDAR pose = nominal pose · translation by (x, y, z), along the nominal LiDAR axes."""

    name: ClassVar = "mount_translation"
    phase: ClassVar = Phase.MOUNT
    channel: ClassVar = "pose"
    equation: ClassVar = "T_true = T · translation(x, y, z)"
    reference: ClassVar = "Levinson, Thrun: Automatic online calibration of cameras and lasers, RSS 2013"
    confusable_with: ClassVar = (
        "range_bias",
        "dual_block",
        "time_offset",
        "box_shrink",
        "elevation_offset",
        "encoder_eccentricity",
    )
    example: ClassVar = {"x_m": 0.3, "y_m": 0.0, "z_m": 0.0}
    neutral: ClassVar = {"x_m": 0.0, "y_m": 0.0, "z_m": 0.0}

    x_m: float = number("shift forward", unit="m", ge=-2, le=2)
    y_m: float = number("shift to the left", unit="m", ge=-2, le=2)
    z_m: float = number("shift up", unit="m", ge=-2, le=2)

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return beams with a shifted mount; the shift is applied before a rotation of the mount."""
        shift = np.eye(4)
        shift[:3, 3] = self.x_m, self.y_m, self.z_m
        return replace(beams, mount=shift @ beams.mount)
