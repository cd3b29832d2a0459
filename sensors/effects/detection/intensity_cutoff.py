"""Echoes weaker than the least signal give no return."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import ScanEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class IntensityCutoff(ScanEffect):
    """I − ε; returns below zero are lost. It acts on the noisy intensity, so that weak returns are lost at random."""

    name: ClassVar = "intensity_cutoff"
    phase: ClassVar = Phase.CUTOFF
    channel: ClassVar = "drop"
    also: ClassVar = ("intensity",)
    equation: ClassVar = "I − ε; lost where I < ε"
    reference: ClassVar = "Synth It Like KITTI, arXiv:2502.15076: ray drop by a small ε"
    confusable_with: ClassVar = ("detection_threshold", "intensity_floor", "random_dropout")
    example: ClassVar = {"epsilon": 0.3}
    neutral: ClassVar = {"epsilon": 0.0}
    is_candidate: ClassVar = False

    epsilon: float = number("ε, least intensity that counts", ge=0, le=0.9)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the remaining returns, weaker by ε."""
        less = replace(returns, intensity=returns.intensity - np.float32(self.epsilon))
        return less.take(less.intensity >= 0)

    def survival(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return 1 for returns that are strong enough, else 0."""
        return (returns.intensity >= np.float32(self.epsilon)).astype(float)
