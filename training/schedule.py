"""One cycle of learning rate and momentum (Smith & Topin, "Super-Convergence", 2018), as a function of the step."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class OneCycle:
    """Learning rate that rises, then falls; Adam's first beta falls, then rises.

    Attributes:
        highest: maximum learning rate.
        steps: number of steps of the training.
    """

    highest: float
    steps: int
    rising: float = 0.4
    begin_share: float = 0.1
    end_share: float = 1e-4
    betas: tuple[float, float] = (0.95, 0.85)

    def at(self, step: int) -> tuple[float, float]:
        """Learning rate and first beta of a step, counted from 0."""
        peak = max(1.0, self.rising * self.steps)
        slow, fast = self.betas
        if step < peak:
            share = step / peak
            return _between(self.begin_share * self.highest, self.highest, share), _between(slow, fast, share)
        share = min(1.0, (step - peak) / max(1.0, self.steps - peak))
        return _between(self.highest, self.end_share * self.highest, share), _between(fast, slow, share)


def _between(begin: float, end: float, share: float) -> float:
    return end + (begin - end) * (1 + math.cos(math.pi * share)) / 2
