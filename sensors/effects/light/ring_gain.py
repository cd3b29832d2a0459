"""Each laser and its receiver have their own gain."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, bounded, per_ring
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class RingGain(EchoEffect):
    """I·gains[i] for returns of laser i."""

    name: ClassVar = "ring_gain"
    phase: ClassVar = Phase.RING_GAIN
    channel: ClassVar = "intensity"
    equation: ClassVar = "I·gains[ring]"
    reference: ClassVar = "Levinson, Thrun: Unsupervised calibration for multi-beam lasers, ISER 2010"
    confusable_with: ClassVar = ("incidence_falloff", "range_falloff")
    example: ClassVar = {"gains": (1.5, 0.6) * 32}
    neutral: ClassVar = {"gains": (1.0,) * 64}

    gains: bounded(0, 10) = per_ring("gain of each laser, ring 0 first")  # type: ignore[valid-type]

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns scaled by ring."""
        gains = np.array(self.gains, np.float32)[shot.rays.ring[returns.beam]]
        return replace(returns, intensity=returns.intensity * gains)
