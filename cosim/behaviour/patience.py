"""SUMO's vehicles wait for bodies that had to take a bend wider."""

from __future__ import annotations

import numpy as np

from cosim.behaviour.stage import Stage

_LATE_M, _BACK_M = 2.5, 1.0
_AHEAD_M = 0.7
_LONGEST_S = 12.0
_ASTRAY_M, _ASTRAY_S = 2.0, 30.0
_LOST_M = 15.0


class Patience:
    """Stops SUMO's vehicle while its body is left behind, and takes bodies away that will not come back.

    Only a body that SUMO's place is ahead of can catch up; where the place lies beside it, SUMO must go on.
    """

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._astray: dict[str, float] = {}

    def step(self, stage: Stage) -> None:
        """Compare bodies with SUMO's places."""
        lag, ahead = stage.motion.lag(), stage.motion.ahead()
        behind = np.where(ahead > _AHEAD_M, lag, 0.0)
        for row in np.flatnonzero(behind > _LATE_M).tolist():
            vehicle = stage.actors.ids[row]
            if vehicle not in stage.busy and vehicle not in self._since and not stage.actors.parked[row]:
                stage.api.vehicle.setSpeed(vehicle, 0.0)
                self._since[vehicle] = stage.actors.time_s
        for vehicle, since in list(self._since.items()):
            row = stage.rows.get(vehicle)
            if row is None:
                del self._since[vehicle]
            elif vehicle in stage.busy or behind[row] < _BACK_M or stage.actors.time_s - since > _LONGEST_S:
                del self._since[vehicle]
                if vehicle not in stage.busy:
                    stage.api.vehicle.setSpeed(vehicle, -1)
        self._give_up(stage, lag)

    def _give_up(self, stage: Stage, lag: np.ndarray) -> None:
        now, before = stage.actors.time_s, self._astray
        self._astray = {}
        for row in np.flatnonzero((lag > _ASTRAY_M) & ~stage.actors.parked).tolist():
            vehicle = stage.actors.ids[row]
            if vehicle in stage.busy:
                continue
            since = self._astray[vehicle] = before.get(vehicle, now)
            if lag[row] > _LOST_M or now - since > _ASTRAY_S:
                stage.take_away(vehicle)
