"""Changes of lane for no reason but a driver's mood."""

from __future__ import annotations

import numpy as np

from cosim.traffic.behaviour.free_driving import MOTORISED, FreeDriving
from cosim.traffic.behaviour.stage import Stage

_CLEAR_OF_ENDS_M = 25.0
_HOLDS_S = 6.0


class LaneChanges:
    """On each road section with several lanes a driver may request a change, left or right, at a random position."""

    def __init__(self, rng: np.random.Generator, driving: FreeDriving) -> None:
        self._rng = rng
        self._driving = driving
        self._edges: dict[str, str] = {}
        self._wants: dict[str, tuple[str, float, int]] = {}  # vehicle → lane, position, step to the side
        self._asked: dict[str, tuple[str, str, float]] = {}  # vehicle → edge, lane wanted, until

    def step(self, stage: Stage) -> None:
        """Draw wishes on new roads, carry out those whose place has come."""
        actors, lanes = stage.actors, stage.roads.lanes
        for row, (vehicle, lane) in enumerate(zip(actors.ids, actors.lanes, strict=True)):
            if not lane or lane[0] == ":" or actors.kinds[row] not in MOTORISED or lane not in lanes:
                continue
            edge = lanes[lane].edge
            if self._edges.get(vehicle) != edge:
                self._edges[vehicle] = edge
                self._wish(stage, vehicle, lane)
            if vehicle in self._wants:
                self._ask(stage, vehicle, row, lane)
            if vehicle in self._asked:
                self._watch(stage, vehicle, lane)

    def _wish(self, stage: Stage, vehicle: str, lane: str) -> None:
        self._wants.pop(vehicle, None)
        own = stage.roads.lanes[lane]
        beside = {other.index for other in stage.roads.of_edge[own.edge]}
        habits = self._driving.habits(stage, vehicle)
        wishes = [
            side
            for side, chance in ((1, habits.changes_left), (-1, habits.changes_right))
            if own.index + side in beside and self._rng.random() < chance
        ]
        if wishes and own.length_m > 2 * _CLEAR_OF_ENDS_M:
            position = float(self._rng.uniform(0.1 * own.length_m, own.length_m - _CLEAR_OF_ENDS_M))
            self._wants[vehicle] = (lane, position, wishes[int(self._rng.integers(len(wishes)))])

    def _ask(self, stage: Stage, vehicle: str, row: int, lane: str) -> None:
        wanted, position, side = self._wants[vehicle]
        if lane != wanted or vehicle in stage.busy:
            del self._wants[vehicle]
            return
        if stage.actors.lane_position_m[row] < position or stage.actors.speed_mps[row] < 2.0:
            return
        del self._wants[vehicle]
        own = stage.roads.lanes[lane]
        target = f"{own.edge}_{own.index + side}"
        stage.api.vehicle.changeLane(vehicle, own.index + side, _HOLDS_S)
        self._asked[vehicle] = (own.edge, target, stage.actors.time_s + _HOLDS_S)

    def _watch(self, stage: Stage, vehicle: str, lane: str) -> None:
        edge, target, until = self._asked[vehicle]
        if lane == target:
            stage.record("lane_change", vehicle)
            del self._asked[vehicle]
        elif stage.roads.lanes[lane].edge != edge or stage.actors.time_s > until:
            del self._asked[vehicle]
