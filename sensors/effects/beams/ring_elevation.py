"""Elevation error of each laser."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, bounded, per_ring
from sensors.effects.phases import Phase
from sensors.shot import Shot


class RingElevation(BeamEffect):
    """True elevation of laser i = reported + offsets[i]; > 0: the true beam is higher."""

    name: ClassVar = "ring_elevation"
    phase: ClassVar = Phase.ELEVATION
    channel: ClassVar = "range"
    equation: ClassVar = "elevation_true[i] = elevation[i] + offsets[i]"
    reference: ClassVar = "Glennie, Lichti: Static calibration of the Velodyne HDL-64E S2, Remote Sensing 2010"
    confusable_with: ClassVar = ("elevation_offset", "ring_range_offset")
    example: ClassVar = {"offsets_deg": (0.4, -0.4) * 32}
    neutral: ClassVar = {"offsets_deg": (0.0,) * 64}

    offsets_deg: bounded(-5, 5) = per_ring("how much higher each true beam is, ring 0 first", unit="°")  # type: ignore[valid-type]

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return the beams raised by ring."""
        return beams.raised(np.radians(np.array(self.offsets_deg))[beams.rays.ring])
