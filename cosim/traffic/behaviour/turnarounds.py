"""Turning round where a street ends: SUMO's way there is tighter than any vehicle's."""

from __future__ import annotations

import numpy as np

from cosim.traffic.behaviour.roads import Lane
from cosim.traffic.behaviour.stage import Stage
from cosim.traffic.motion import TurnError, plan_turn
from cosim.traffic.motion.turn_path import Room

_NOBODY = np.zeros((0, 5))
_CRAWLS_MPS = 2.0
_STUCK_S = 30.0  # across the street, before a queue that waits for him
_ROOMS_M = ((3.0, 9.0), (8.0, 14.0), (10.0, 24.0))  # to the right and left of the way in


class Turnarounds:
    """Moves vehicles that enter a turnaround along arcs, while SUMO's vehicle waits beyond it."""

    def __init__(self) -> None:
        self._turning: dict[str, Lane] = {}

    def step(self, stage: Stage) -> None:
        """Start and end turns."""
        for row, (vehicle, lane) in enumerate(zip(stage.actors.ids, stage.actors.lanes, strict=True)):
            if lane not in stage.roads.turnarounds or stage.actors.kinds[row] == "tram":
                continue
            if vehicle not in stage.busy and vehicle not in self._turning:
                self._begin(stage, row, vehicle, stage.roads.turnarounds[lane])
        for vehicle, back in list(self._turning.items()):
            row = stage.rows.get(vehicle)
            plays = stage.motion.plays(vehicle)
            if row is not None and plays and stage.motion.stuck_s()[row] > _STUCK_S and stage.take_away(vehicle):
                continue
            if row is not None and plays and stage.actors.lanes[row] == back.id:
                stage.api.vehicle.setSpeed(vehicle, 0.0)
            elif row is None or not plays:
                del self._turning[vehicle]
                stage.busy.discard(vehicle)
                stage.steered.discard(vehicle)
                if row is not None:
                    stage.api.vehicle.setSpeed(vehicle, -1)

    def _begin(self, stage: Stage, row: int, vehicle: str, back: Lane) -> None:
        actors = stage.actors
        position, heading = actors.front[row, :2], float(actors.heading_rad[row])
        away = back.shape[0] - position
        goal = float(away[1] * np.cos(heading) - away[0] * np.sin(heading))
        for right, left in _ROOMS_M:
            room = Room(right_m=-right, left_m=max(left, goal + 1.5), goal_m=goal, boxes=_NOBODY)
            try:
                script = plan_turn(position, heading, actors.kinds[row], actors.size[row], room, stage.step_s)
            except TurnError:
                continue
            stage.motion.play(vehicle, script)
            stage.api.vehicle.setSpeed(vehicle, _CRAWLS_MPS)
            stage.busy.add(vehicle)
            stage.steered.add(vehicle)
            self._turning[vehicle] = back
            return
