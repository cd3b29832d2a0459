"""Selection of vehicles near the ego vehicle, or in a manoeuvre, that move as bodies; SUMO moves the others."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from cosim.traffic.simulation import Traffic

_EVERY_S = 0.5
_MARGIN_M = 25.0  # two who drive towards each other come 15 m nearer between two looks; then some way to settle on
_LEAVES_M = 15.0  # beyond that before one is left to SUMO again


class Vicinity:
    """Selects the vehicles to observe twice a second.

    Args:
        traffic: the simulation.
        centre: the vehicle that is followed (the ego), or a place (2,) in the town's axes.
        sight_m: who comes so near has been attended to for a while.

    Attributes:
        share: of all vehicles that drive, those attended to.
    """

    def __init__(self, traffic: Traffic, centre: str | np.ndarray, sight_m: float) -> None:
        self._traffic = traffic
        self._centre = centre
        self._reach_m = sight_m + _MARGIN_M
        self._every_steps = max(1, round(_EVERY_S / traffic.step_s))
        self._steps = 0
        self._near: set[str] = set()
        self.share = 1.0

    def look(self, acting: Collection[str]) -> None:
        """Look round if it is time to, before a step.

        Args:
            acting: vehicles in a manoeuvre: they are attended to wherever they are.
        """
        self._steps += 1
        if (self._steps - 1) % self._every_steps:
            return
        driving, parked, walking, places = self._traffic.places()
        if isinstance(self._centre, str) and self._centre not in driving:
            return
        here = places[driving.index(self._centre)] if isinstance(self._centre, str) else self._centre
        away = np.hypot(*(places - here).T).tolist()
        names = [*driving, *parked, *walking]
        reach_m, stays_m = self._reach_m, self._reach_m + _LEAVES_M
        near = {
            name for name, m in zip(names, away, strict=True) if m < reach_m or (m < stays_m and name in self._near)
        }
        near.update(acting)
        self._near = near
        driven = [name for name in driving if name in near]
        self._traffic.attend(
            driven, [name for name in parked if name in near], [name for name in walking if name in near]
        )
        self.share = len(driven) / max(len(driving), 1)
