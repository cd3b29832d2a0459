"""Resolution of deadlocks at junctions where all vehicles wait for each other."""

from __future__ import annotations

from cosim.traffic.behaviour.stage import Stage

_EVERY_STEPS = 10
_STANDS_MPS = 0.1
_INSIDE_S, _BEFORE_S = 15.0, 45.0  # standing inside a junction, and first before it
_AT_THE_LINE_M = 3.0
_GOES_FIRST_S = 6.0
_CAREFUL, _GOES_FIRST = (
    31,
    55,
)  # SUMO's speed modes: all checks; right of way is ignored except at red lights


class Gridlock:
    """Gives priority to one of the vehicles that have waited long at a junction; in SUMO they would wait for ever.

    Bodies keep apart all the same.
    """

    def __init__(self) -> None:
        self._stands: dict[str, float] = {}  # since
        self._goes: dict[str, tuple[str, float]] = {}  # vehicle → junction, until

    def step(self, stage: Stage) -> None:
        """Look at all junctions once a second."""
        actors, api = stage.actors, stage.api.vehicle
        if round(actors.time_s / stage.step_s) % _EVERY_STEPS:
            return
        for vehicle, (_, until) in list(self._goes.items()):
            if actors.time_s >= until or vehicle not in stage.rows:
                del self._goes[vehicle]
                if vehicle in stage.rows and vehicle not in stage.steered:
                    api.setSpeedMode(vehicle, _CAREFUL)
        before, self._stands = self._stands, {}
        longest: dict[str, tuple[float, str]] = {}
        for row, (vehicle, name) in enumerate(zip(actors.ids, actors.lanes, strict=True)):
            lane = stage.roads.lanes.get(name)
            if lane is None or actors.parked[row] or actors.speed_mps[row] > _STANDS_MPS or vehicle in stage.busy:
                continue
            inside = name.startswith(":")
            if not inside and lane.length_m - actors.lane_position_m[row] > _AT_THE_LINE_M:
                continue
            since = self._stands[vehicle] = before.get(vehicle, actors.time_s)
            late = actors.time_s - since - (_INSIDE_S if inside else _BEFORE_S)
            if late > 0:
                junction = name[1:].rsplit("_", 2)[0] if inside else stage.api.edge.getToJunction(lane.edge)
                longest[junction] = max(longest.get(junction, (0.0, "")), (late, vehicle))
        self._look_far(stage, longest)
        for junction, (_, vehicle) in sorted(longest.items()):
            if junction not in {at for at, _ in self._goes.values()}:
                api.setSpeedMode(vehicle, _GOES_FIRST)
                self._goes[vehicle] = junction, actors.time_s + _GOES_FIRST_S
                self._stands[vehicle] = actors.time_s  # then it is another's turn

    def _look_far(self, stage: Stage, longest: dict[str, tuple[float, str]]) -> None:
        """Extend the look-ahead of vehicles that only SUMO moves."""
        api = stage.api.vehicle
        for vehicle in sorted(stage.traffic.far):
            waits_s = api.getWaitingTime(vehicle)
            if waits_s < _INSIDE_S or api.isStopped(vehicle):
                continue
            name = api.getLaneID(vehicle)
            lane, inside = stage.roads.lanes.get(name), name.startswith(":")
            if lane is None or not (inside or lane.length_m - api.getLanePosition(vehicle) < _AT_THE_LINE_M):
                continue
            late = waits_s - (_INSIDE_S if inside else _BEFORE_S)
            if late > 0:
                junction = name[1:].rsplit("_", 2)[0] if inside else stage.api.edge.getToJunction(lane.edge)
                longest[junction] = max(longest.get(junction, (0.0, "")), (late, vehicle))
