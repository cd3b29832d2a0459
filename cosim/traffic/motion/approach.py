"""Moving over to a parking place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.traffic.motion import drift

_STEP_M = 0.1


@dataclass(frozen=True)
class Approach:
    """A way to a parking place at the kerb.

    Attributes:
        stop: (2,) position of SUMO's front bumper on the lane when it jumps to the parking space.
        offset_m: lateral position of the place, positive to the left.
        start_m, end_m: distances before `stop` between which the vehicle moves over.
    """

    stop: np.ndarray
    offset_m: float
    start_m: float
    end_m: float

    def over(self, left_m: float) -> tuple[float, float]:
        """Share of the way over that is done at a distance before `stop`, and how much it grows a metre."""
        span = self.start_m - self.end_m
        done = 1 - drift.smooth((self.start_m - left_m + np.array([0.0, _STEP_M])) / span)
        return float(done[0]), float(done[1] - done[0]) / _STEP_M
