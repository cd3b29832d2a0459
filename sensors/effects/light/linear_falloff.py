"""Intensity decreases linearly with range."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class LinearFalloff(EchoEffect):
    """I·max(1 − R/R_end, 0): the straight line of simulators for sensors that compensate their gain over range."""

    name: ClassVar = "linear_falloff"
    phase: ClassVar = Phase.LINEAR_FALLOFF
    channel: ClassVar = "intensity"
    equation: ClassVar = "I·max(1 − R/R_end, 0)"
    reference: ClassVar = "Synth It Like KITTI, arXiv:2502.15076, published code: 1 − d/120"
    confusable_with: ClassVar = ("range_falloff", "atmospheric_extinction")
    example: ClassVar = {"end_m": 120.0}
    is_candidate: ClassVar = False

    end_m: float = number("R_end, where nothing is left", unit="m", ge=10, le=1000)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns attenuated with range."""
        left = np.maximum(1 - returns.range_m / np.float32(self.end_m), np.float32(0))
        return replace(returns, intensity=returns.intensity * left)
