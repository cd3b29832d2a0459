"""Common elevation error of all lasers."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, number
from sensors.effects.phases import Phase
from sensors.shot import Shot


class ElevationOffset(BeamEffect):
    """True elevation = reported + offset; offset > 0: the true beam is higher."""

    name: ClassVar = "elevation_offset"
    phase: ClassVar = Phase.ELEVATION
    channel: ClassVar = "range"
    equation: ClassVar = "elevation_true = elevation + offset"
    reference: ClassVar = "Deschaud: IMLS-SLAM, ICRA 2018 (about 0.2° in KITTI's scans)"
    confusable_with: ClassVar = (
        "mount_rotation",
        "ring_elevation",
        "suspension_pitch",
        "mount_translation",
        "dual_block",
    )
    example: ClassVar = {"offset_deg": 0.5}
    neutral: ClassVar = {"offset_deg": 0.0}

    offset_deg: float = number("how much higher the true beams are", unit="°", ge=-5, le=5)

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return the beams raised in their vertical planes."""
        return beams.raised(np.radians(self.offset_deg))
