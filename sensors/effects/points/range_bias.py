"""Constant range bias."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import PointEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class RangeBias(PointEffect):
    """R + offset."""

    name: ClassVar = "range_bias"
    phase: ClassVar = Phase.RANGE_BIAS
    channel: ClassVar = "range"
    equation: ClassVar = "R + b"
    reference: ClassVar = "Glennie, Lichti: Static calibration of the Velodyne HDL-64E S2, Remote Sensing 2010"
    confusable_with: ClassVar = ("mount_translation", "ring_range_offset", "range_walk", "box_shrink", "range_scale")
    example: ClassVar = {"offset_m": 0.2}
    neutral: ClassVar = {"offset_m": 0.0}

    offset_m: float = number("b, what is added", unit="m", ge=-5, le=5)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with shifted ranges."""
        return replace(returns, range_m=returns.range_m + np.float32(self.offset_m))
