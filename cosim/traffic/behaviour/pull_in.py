"""Drivers who park at the kerb."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.traffic.behaviour.backing_in import BackingIn
from cosim.traffic.behaviour.roads import Lane, ParkingSpace
from cosim.traffic.behaviour.stage import Stage
from cosim.traffic.motion import Approach, drift
from cosim.traffic.motion.rehearsal import clear, rehearse

_FOR_EVER_S = 1_000_000.0
# Start and end of the lateral movement before the space; with enough room it is long and the vehicle ends straight.
_WAYS_M = ((26.0, 12.0), (22.0, 10.0), (19.0, 8.0), (17.0, 7.0), (16.0, 6.0), (14.0, 5.0), (13.0, 4.0))
_AHEAD_M = (45.0, 160.0)  # of a driver who looks for a place
_EDGES_AHEAD = 4
_BENDS_RAD = np.radians(15.0)  # a lane on the way to a place, or a way across a junction
_ACROSS_M = 10.0  # at least
_ASKEW_RAD = np.radians(4.0)  # as for most vehicles that are parked from the start
_BESIDE_M = 0.1  # farthest from the middle of the place
_GENTLY_MPS = 2.5  # as rehearsed
_BRAKES_MPS2 = 1.5
_MARGIN_M = 0.12
_LONGEST_M = 5.0
_BEFORE_M, _STEP_M = 28.0, 2.0
_PLACES_TRIED, _DRIVERS_TRIED = 3, 4


@dataclass(frozen=True, eq=False)
class _Going:
    """Someone on the way to a place.

    Attributes:
        lot: the place.
        approach: how he moves over to it.
        before_m: along the lane from where on he drives gently.
    """

    lot: ParkingSpace
    approach: Approach
    before_m: float


class PullIn:
    """A driver takes a free place on his way, forwards where he can, else backwards, and stays there."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._due = 0
        self._backing = BackingIn()
        self._going: dict[str, _Going] = {}
        self._next_to_space: set[str] = set()  # vehicles that are next to their space already
        self._fastest: dict[str, float] = {}  # of those who have slowed down [m/s]

    def step(self, stage: Stage) -> None:
        """Choose vehicles and spaces; note when they have stopped."""
        self._due = min(self._due + stage.due(stage.config.pull_ins_per_min, self._rng), 3)
        if self._due and round(stage.actors.time_s / stage.step_s) % 10 == 5:
            self._due -= self._begin(stage)
        self._backing.step(stage)
        for vehicle, going in list(self._going.items()):
            row = stage.rows.get(vehicle)
            if row is None or stage.actors.parked[row]:
                if row is not None:
                    stage.record("pull_in", vehicle)
                self._end(stage, vehicle)
                continue
            if vehicle not in self._next_to_space and stage.actors.lanes[row] == going.lot.lane:
                self._next_to_space.add(vehicle)
                stage.motion.approach(vehicle, going.approach)
            if vehicle not in self._fastest:
                self._slow_down(stage, row, going)

    def _slow_down(self, stage: Stage, row: int, going: _Going) -> None:
        vehicle, api, lot = stage.actors.ids[row], stage.api.vehicle, going.lot
        slows_m = max(float(stage.actors.speed_mps[row]) ** 2 - _GENTLY_MPS**2, 0.0) / (2 * _BRAKES_MPS2)
        left = api.getDrivingDistance(vehicle, stage.roads.lanes[lot.lane].edge, lot.end_m)
        if 0 < left < going.before_m + slows_m:
            self._fastest[vehicle] = api.getMaxSpeed(vehicle)
            api.setMaxSpeed(vehicle, _GENTLY_MPS)

    def _end(self, stage: Stage, vehicle: str) -> None:
        del self._going[vehicle]
        self._next_to_space.discard(vehicle)
        stage.busy.discard(vehicle)
        fastest = self._fastest.pop(vehicle, None)
        if fastest is not None and vehicle in stage.rows:
            stage.api.vehicle.setMaxSpeed(vehicle, fastest)

    def _begin(self, stage: Stage) -> bool:
        actors = stage.actors
        rows = [
            row
            for row, (vehicle, lane) in enumerate(zip(actors.ids, actors.lanes, strict=True))
            if actors.kinds[row] == "car"
            and actors.size[row, 0] <= _LONGEST_M
            and lane in stage.roads.lanes
            and not lane.startswith(":")
            and not (vehicle in stage.exempt or actors.parked[row] or stage.engaged(vehicle))
        ]
        tried = 0
        for i in self._rng.permutation(len(rows)).tolist():
            free = self._free_ahead(stage, rows[i])
            places = free[:_PLACES_TRIED]
            if any(self._try(stage, rows[i], lot, straight_m) for lot, straight_m in places):
                return True
            if any(self._backing.begin(stage, rows[i], lot) for lot, _ in places):
                return True
            tried += bool(free)
            if tried == _DRIVERS_TRIED:
                break
        return False

    def _free_ahead(self, stage: Stage, row: int) -> list[tuple[ParkingSpace, float]]:
        """Free places on a driver's way, the nearest first, and how far he drives straight on before each [m].

        Next to other edges than the vehicle's own only if a single lane leads past.
        """
        api, roads, actors = stage.api, stage.roads, stage.actors
        vehicle, own = actors.ids[row], roads.lanes[actors.lanes[row]]
        sought = {going.lot.lane for going in self._going.values()} | self._backing.lanes
        at = api.vehicle.getRouteIndex(vehicle)
        way, free, before = -float(actors.lane_position_m[row]), [], None
        for edge in api.vehicle.getRoute(vehicle)[at : at + _EDGES_AHEAD]:
            lane = own if edge == own.edge else roads.of_edge[edge][0]
            across = _ACROSS_M if before is not None and _leads_straight(before, lane) else -_STEP_M
            if lane.id not in sought and (edge == own.edge or len(roads.of_edge[edge]) == 1):
                free += [
                    (lot, lot.end_m + across)
                    for lot in roads.lots.get(edge, ())
                    if lot.lane == lane.id
                    and _AHEAD_M[0] < way + lot.end_m < _AHEAD_M[1]
                    and not api.parkingarea.getVehicleIDs(lot.id)
                ]
            way, before = way + lane.length_m, lane
        return free

    def _try(self, stage: Stage, row: int, lot: ParkingSpace, straight_m: float) -> bool:
        actors, vehicle = stage.actors, stage.actors.ids[row]
        lane = stage.roads.lanes[lot.lane]
        before = min(_BEFORE_M, straight_m)
        begin = lot.end_m - before
        along = np.unwrap([lane.point(at)[1] for at in np.arange(max(begin, 0.0), lot.end_m + _STEP_M, _STEP_M)])
        if np.ptp(along) > _BENDS_RAD:
            return False
        stop = lane.point(lot.end_m)[0]
        aside = -(lane.width_m + stage.roads.right_room(lane.edge)) / 2
        size = actors.size[row]
        boxes = _next_to_space(lane, stage.boxes_near(stop, vehicle), begin)
        boxes = boxes[boxes[:, 1] < aside / 2]
        for start, end in _WAYS_M:
            if start > before:
                continue

            def offset(x: np.ndarray, start: float = start, end: float = end) -> np.ndarray:
                return aside * (1 - drift.smooth((start - (before - x)) / (start - end)))

            poses = rehearse(actors.kinds[row], size[0], before, offset)
            stands_well = abs(poses[-1, 2]) < _ASKEW_RAD and abs(poses[-1, 1] - aside) < _BESIDE_M
            if stands_well and clear(poses, size, boxes, _MARGIN_M):
                stage.api.vehicle.setParkingAreaStop(vehicle, lot.id, _FOR_EVER_S)
                stage.busy.add(vehicle)
                self._going[vehicle] = _Going(lot, Approach(stop, aside, start, end), before)
                return True
        return False


def _leads_straight(lane: Lane, onward: Lane) -> bool:
    """Return whether the path from one lane to the next is almost straight."""
    turn = onward.point(0.0)[1] - lane.point(lane.length_m)[1]
    return abs((turn + np.pi) % (2 * np.pi) - np.pi) < _BENDS_RAD


def _next_to_space(lane: Lane, boxes: np.ndarray, begin_m: float) -> np.ndarray:
    """Boxes (k, 5) in axes that bend with a lane: x along it from a position on, y to the left."""
    turned = np.zeros((len(boxes), 5))
    for row, box in enumerate(boxes):
        at, left = lane.project(box[:2])
        turned[row] = at - begin_m, left, box[2] - lane.point(at)[1], *box[3:]
    return turned
