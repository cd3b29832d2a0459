"""Drivers who park at the kerb."""

from __future__ import annotations

import numpy as np

from cosim.behaviour.roads import Lot
from cosim.behaviour.stage import Stage, in_axes
from cosim.motion import Approach, drift
from cosim.motion.rehearsal import clear, rehearse

_FOR_EVER_S = 1_000_000.0
_WAYS_M = ((14.0, 5.0), (16.0, 6.0), (17.0, 7.0), (19.0, 8.0), (22.0, 10.0), (26.0, 12.0))
_AHEAD_M = 45.0
_STRAIGHT_RAD = np.radians(2.0)
_BESIDE_M = 0.1  # farthest from the middle of the place
_GENTLY_MPS = 2.5  # as rehearsed
_BRAKES_MPS2 = 1.5
_MARGIN_M = 0.12
_LONGEST_M = 5.0
_BEFORE_M = 28.0
_LOTS_TRIED, _DRIVERS_TRIED = 3, 4


class PullIn:
    """A driver takes a free place that he can drive into forwards, and stays there."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._due = 0
        self._going: dict[str, Lot] = {}
        self._fastest: dict[str, float] = {}  # of those who have slowed down [m/s]

    def step(self, stage: Stage) -> None:
        """Choose who parks where; note when he stands."""
        self._due = min(self._due + stage.due(stage.config.pull_ins_per_min, self._rng), 3)
        if self._due and round(stage.actors.time_s / stage.step_s) % 10 == 5:
            self._due -= self._begin(stage)
        for vehicle in list(self._going):
            row = stage.rows.get(vehicle)
            if row is None or stage.actors.parked[row]:
                if row is not None:
                    stage.record("pull_in", vehicle)
                self._end(stage, vehicle)
            elif vehicle not in self._fastest:
                self._slow_down(stage, row, self._going[vehicle])

    def _slow_down(self, stage: Stage, row: int, lot: Lot) -> None:
        actors = stage.actors
        if actors.lanes[row] != lot.lane:
            return
        slows_m = max(float(actors.speed_mps[row]) ** 2 - _GENTLY_MPS**2, 0.0) / (2 * _BRAKES_MPS2)
        if lot.end_m - actors.lane_position_m[row] < _BEFORE_M + slows_m:
            vehicle, api = actors.ids[row], stage.api.vehicle
            self._fastest[vehicle] = api.getMaxSpeed(vehicle)
            api.setMaxSpeed(vehicle, _GENTLY_MPS)

    def _end(self, stage: Stage, vehicle: str) -> None:
        del self._going[vehicle]
        stage.busy.discard(vehicle)
        fastest = self._fastest.pop(vehicle, None)
        if fastest is not None and vehicle in stage.rows:
            stage.api.vehicle.setMaxSpeed(vehicle, fastest)

    def _begin(self, stage: Stage) -> bool:
        actors = stage.actors
        found = []
        for row, (vehicle, lane) in enumerate(zip(actors.ids, actors.lanes, strict=True)):
            own = stage.roads.lanes.get(lane)
            if own is None or actors.kinds[row] != "car" or actors.size[row, 0] > _LONGEST_M:
                continue
            if vehicle in stage.busy or vehicle in stage.exempt or actors.parked[row]:
                continue
            near = actors.lane_position_m[row] + _AHEAD_M
            places = [lot for lot in stage.roads.lots.get(own.edge, ()) if lot.lane == lane and lot.end_m > near]
            if places:
                found.append((row, places))
        if not found:
            return False
        taken = {lot.id for lot in self._going.values()}
        for i in self._rng.permutation(len(found))[:_DRIVERS_TRIED].tolist():
            row, places = found[i]
            free = [lot for lot in places if lot.id not in taken and not stage.api.parkingarea.getVehicleIDs(lot.id)]
            if any(self._try(stage, row, lot) for lot in free[:_LOTS_TRIED]):
                return True
        return False

    def _try(self, stage: Stage, row: int, lot: Lot) -> bool:
        actors, vehicle = stage.actors, stage.actors.ids[row]
        lane = stage.roads.lanes[lot.lane]
        stop, heading = lane.point(lot.end_m)
        aside = -(lane.width_m + stage.roads.right_room(lane.edge)) / 2
        size = actors.size[row]
        for start, end in _WAYS_M:
            origin = stop - _BEFORE_M * np.array([np.cos(heading), np.sin(heading)])
            boxes = in_axes(stage.boxes_near(stop, vehicle), origin, heading)
            boxes = boxes[boxes[:, 1] < aside / 2]

            def offset(x: np.ndarray, start: float = start, end: float = end) -> np.ndarray:
                return aside * (1 - drift.smooth((start - (_BEFORE_M - x)) / (start - end)))

            poses = rehearse(actors.kinds[row], size[0], _BEFORE_M, offset)
            stands_well = abs(poses[-1, 2]) < _STRAIGHT_RAD and abs(poses[-1, 1] - aside) < _BESIDE_M
            if stands_well and clear(poses, size, boxes, _MARGIN_M):
                stage.api.vehicle.setParkingAreaStop(vehicle, lot.id, _FOR_EVER_S)
                stage.motion.approach(vehicle, Approach(stop, aside, start, end))
                stage.busy.add(vehicle)
                self._going[vehicle] = lot
                return True
        return False
