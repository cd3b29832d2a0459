"""Drivers who back into a place between others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.traffic.behaviour.roads import Lane, ParkingSpace
from cosim.traffic.behaviour.stage import Stage, in_axes
from cosim.traffic.motion import Script
from cosim.traffic.motion.park_path import plan_backing_in

_FOR_EVER_S = 1_000_000.0
_WAITS_AT = 0.9  # vehicle lengths past the start of the space, so that vehicles waiting behind leave it free
_BENDS_RAD = np.radians(12.0)
_REACHES_M = 8.0  # past the place
_BACK_M = (0.0, 0.4, 0.8, 1.2, 1.6)  # behind the end of the place, and at most as far as there is room
_CLEAR_M = 0.15
_STANDS_MPS = 0.02
_PATIENCE_S = 20.0
_EVERY_STEPS = 5
_HOLD_STEPS = 80  # until SUMO has parked him


@dataclass(eq=False)
class _Backing:
    lot: ParkingSpace
    since_s: float = np.inf  # time at which the vehicle has stopped next to the space
    plays: bool = False
    resumed: bool = False
    stands: bool = False


class BackingIn:
    """Reverse parking: a vehicle stops next to a space, passes it and backs in, while others wait behind.

    SUMO's vehicle stays on the lane meanwhile, and is parked when the manoeuvre is complete.
    """

    def __init__(self) -> None:
        self._backing: dict[str, _Backing] = {}

    @property
    def lanes(self) -> set[str]:
        """Spaces that a vehicle is about to park in."""
        return {backing.lot.lane for backing in self._backing.values()}

    def begin(self, stage: Stage, row: int, lot: ParkingSpace) -> bool:
        """Send a vehicle to a space; return whether it can back in between the vehicles parked there now."""
        vehicle, lane = stage.actors.ids[row], stage.roads.lanes[lot.lane]
        waits_m = lot.start_m + _WAITS_AT * float(stage.actors.size[row, 0])
        heading = [lane.point(at)[1] for at in np.arange(lot.start_m, lot.end_m + _REACHES_M, 2.0)]
        if np.ptp(np.unwrap(heading)) > _BENDS_RAD or lane.length_m < lot.end_m + _REACHES_M / 2:
            return False
        if self._plan(stage, row, lot, lane, lane.point(waits_m)[0], heading[0], everyone=False) is None:
            return False
        stage.api.vehicle.setStop(vehicle, lane.edge, waits_m, lane.index, _FOR_EVER_S)
        stage.busy.add(vehicle)
        self._backing[vehicle] = _Backing(lot)
        return True

    def step(self, stage: Stage) -> None:
        """Take everyone a step further."""
        for vehicle, backing in list(self._backing.items()):
            row = stage.rows.get(vehicle)
            if row is None or not self._carry_on(stage, row, backing):
                del self._backing[vehicle]
                stage.busy.discard(vehicle)
                stage.steered.discard(vehicle)

    def _carry_on(self, stage: Stage, row: int, backing: _Backing) -> bool:
        actors, vehicle, api = stage.actors, stage.actors.ids[row], stage.api.vehicle
        if backing.plays:
            if not backing.resumed and stage.motion.steps_left(vehicle) < _HOLD_STEPS:
                backing.resumed = True
                api.resume(vehicle)
            if actors.parked[row] and not backing.stands:
                backing.stands = True
                stage.record("pull_in", vehicle)
            return stage.motion.plays(vehicle)
        if actors.lanes[row] != backing.lot.lane or actors.speed_mps[row] > _STANDS_MPS or not api.isStopped(vehicle):
            return True
        backing.since_s = min(backing.since_s, actors.time_s)
        if round((actors.time_s - backing.since_s) / stage.step_s) % _EVERY_STEPS == 0:
            lane, position = stage.roads.lanes[backing.lot.lane], actors.front[row, :2]
            script = self._plan(stage, row, backing.lot, lane, position, float(actors.heading_rad[row]), everyone=True)
            if script is not None:
                rows = np.minimum(np.arange(len(script) + _HOLD_STEPS), len(script) - 1)
                stage.motion.play(vehicle, Script(script.front[rows], script.heading_rad[rows]))
                stage.steered.add(vehicle)
                api.setParkingAreaStop(vehicle, backing.lot.id, _FOR_EVER_S)
                backing.plays = True
        if not backing.plays and actors.time_s - backing.since_s > _PATIENCE_S:
            api.resume(vehicle)
            return False
        return True

    def _plan(
        self,
        stage: Stage,
        row: int,
        lot: ParkingSpace,
        lane: Lane,
        front: np.ndarray,
        heading: float,
        *,
        everyone: bool,
    ) -> Script | None:
        """A way from a place on the lane, past those at the kerb or past everyone but those who wait behind."""
        actors, size = stage.actors, stage.actors.size[row]
        along = lane.point((lot.start_m + lot.end_m) / 2)[1]
        aside = (lane.width_m + stage.roads.right_room(lane.edge)) / 2
        right = aside * np.array([np.sin(along), -np.cos(along)])
        boxes = in_axes(stage.boxes_near(front, actors.ids[row]), front, along)
        kerb = boxes[:, 1] < -aside / 2
        boxes = boxes[kerb | (boxes[:, 0] > -size[0])] if everyone else boxes[kerb]
        askew = (heading - along + np.pi) % (2 * np.pi) - np.pi
        for back in _BACK_M:
            if back > lot.end_m - lot.start_m - size[0]:
                break
            stop = lane.point(lot.end_m - back)[0] + right - front
            position = np.array([stop @ (np.cos(along), np.sin(along)), stop @ (-np.sin(along), np.cos(along))])
            script = plan_backing_in(
                front, along, actors.kinds[row], size, position, askew, boxes, _CLEAR_M, stage.step_s
            )
            if script is not None:
                return script
        return None
