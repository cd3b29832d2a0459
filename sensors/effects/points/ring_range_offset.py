"""Each laser has its own range error."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import PointEffect, bounded, per_ring
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class RingRangeOffset(PointEffect):
    """R + offsets[i] for returns of laser i."""

    name: ClassVar = "ring_range_offset"
    phase: ClassVar = Phase.RING_OFFSET
    channel: ClassVar = "range"
    equation: ClassVar = "R + offsets[ring]"
    reference: ClassVar = "Velodyne HDL-64E S2 user's manual, distCorrection"
    confusable_with: ClassVar = ("range_bias", "ring_elevation")
    example: ClassVar = {"offsets_m": (0.1, -0.1) * 32}
    neutral: ClassVar = {"offsets_m": (0.0,) * 64}

    offsets_m: bounded(-5, 5) = per_ring("what is added for each laser, ring 0 first", unit="m")  # type: ignore[valid-type]

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with ranges shifted by ring."""
        offsets = np.array(self.offsets_m, np.float32)[shot.rays.ring[returns.beam]]
        return replace(returns, range_m=returns.range_m + offsets)
