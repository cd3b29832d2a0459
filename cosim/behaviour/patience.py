"""SUMO's vehicles wait for bodies that had to take a bend wider."""

from __future__ import annotations

import numpy as np

from cosim.behaviour.stage import Stage

_LATE_M, _BACK_M = 2.5, 1.0
_LONGEST_S = 12.0


class Patience:
    """Stops SUMO's vehicle while its body is left behind."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}

    def step(self, stage: Stage) -> None:
        """Compare bodies with SUMO's places."""
        lag = stage.motion.lag()
        for row in np.flatnonzero(lag > _LATE_M).tolist():
            vehicle = stage.actors.ids[row]
            if vehicle not in stage.busy and vehicle not in self._since and not stage.actors.parked[row]:
                stage.api.vehicle.setSpeed(vehicle, 0.0)
                self._since[vehicle] = stage.actors.time_s
        for vehicle, since in list(self._since.items()):
            row = stage.rows.get(vehicle)
            if row is None:
                del self._since[vehicle]
            elif vehicle in stage.busy or lag[row] < _BACK_M or stage.actors.time_s - since > _LONGEST_S:
                del self._since[vehicle]
                if vehicle not in stage.busy:
                    stage.api.vehicle.setSpeed(vehicle, -1)
