"""Routes are extended so that no vehicle is removed in the middle of a town."""

from __future__ import annotations

import numpy as np

from cosim.traffic.behaviour.free_driving import MOTORISED
from cosim.traffic.behaviour.stage import Stage

_EVERY_STEPS = 50


class Onward:
    """Gives drivers who near the end of their route another one, so that they do not vanish there."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def step(self, stage: Stage) -> None:
        """Look at all routes now and then."""
        actors = stage.actors
        if round(actors.time_s / stage.step_s) % _EVERY_STEPS:
            return
        for vehicle in sorted(stage.traffic.far):
            stage.traffic.prolong_route(vehicle, self._rng)
        for row, vehicle in enumerate(actors.ids):
            drives = actors.kinds[row] in MOTORISED and actors.lanes[row] and not actors.parked[row]
            if drives and vehicle not in stage.busy:
                stage.traffic.prolong_route(vehicle, self._rng)
