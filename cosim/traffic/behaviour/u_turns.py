"""Turning round, in the middle of the road or where a street ends."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count

import numpy as np

from cosim.traffic.behaviour.roads import Lane
from cosim.traffic.behaviour.routes import wander
from cosim.traffic.behaviour.stage import Stage, in_axes
from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion import Script, TurnError, plan_turn
from cosim.traffic.motion.turn_path import Room

_KINDS = ("car", "van")
_LONGEST_M = 5.6
_CLEAR_OF_ENDS_M = 24.0
_BRAKES_MPS2 = 1.8
_KERB_M = 0.1  # corners keep this far from kerbs
_OVER_KERB_M = 0.8  # how far they reach over them where the road is too narrow
_MARGIN_M = 1.5  # kept free before and behind the turn
_PATIENCE_S = 15.0
_LONGEST_S = 60.0
_HOLD_STEPS = 8
_AT_ONCE = 2
_NOBODY = np.zeros((0, 5))
_TURNAROUND_MPS = 2.0
_STUCK_ACROSS_S = 30.0  # across the street, before a queue that waits for him
_TURNAROUND_ROOMS_M = ((3.0, 9.0), (8.0, 14.0), (10.0, 24.0))  # to the right and left of the way in


@dataclass(eq=False)
class _Turn:
    vehicle: str
    lane: Lane
    back: Lane
    start_s: float
    keeper: str = ""
    script: Script | None = None
    moved: bool = False


class UTurns:
    """A driver stops, waits until the road is free, and turns round in one or several arcs.

    SUMO has no U-turns away from junctions. SUMO's vehicle stays on its lane while its pose follows a script, an
    invisible keeper of the same kind blocks the other direction (SUMO inserts it only where oncoming traffic can still
    stop), and at the end the vehicle is put in the keeper's place with a new route.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._due = 0
        self._turns: list[_Turn] = []
        self._numbers = count()

    def step(self, stage: Stage) -> None:
        """Choose who turns and take everyone who does a step further."""
        self._due = min(self._due + stage.due(stage.config.u_turns_per_min, self._rng), 3)
        if self._due and len(self._turns) < _AT_ONCE and round(stage.actors.time_s / stage.step_s) % 10 == 3:
            self._due -= self._begin(stage)
        for turn in list(self._turns):
            if not self._carry_on(stage, turn):
                self._end(stage, turn)

    def _begin(self, stage: Stage) -> bool:
        actors, found = stage.actors, []
        for row, (vehicle, name) in enumerate(zip(actors.ids, actors.lanes, strict=True)):
            lane = stage.roads.lanes.get(name)
            if lane is None or lane.edge.startswith(":") or lane.edge not in stage.roads.back:
                continue
            if actors.kinds[row] not in _KINDS or actors.size[row, 0] > _LONGEST_M or stage.engaged(vehicle):
                continue
            speed, at = float(actors.speed_mps[row]), float(actors.lane_position_m[row])
            stop = at + speed**2 / (2 * _BRAKES_MPS2)
            innermost = lane is stage.roads.of_edge[lane.edge][-1]
            if innermost and speed > 1.0 and _CLEAR_OF_ENDS_M < stop < lane.length_m - _CLEAR_OF_ENDS_M:
                found.append((row, lane, stop))
        for i in self._rng.permutation(len(found)).tolist()[:8]:
            row, lane, stop = found[i]
            back = stage.roads.of_edge[stage.roads.back[lane.edge]][-1]
            position, heading = lane.point(stop)
            if self._plan(stage, row, lane, back, position, heading, only_parked=True) is None:
                continue
            vehicle = actors.ids[row]
            seconds = max(float(actors.speed_mps[row]) / _BRAKES_MPS2, 1.0)
            stage.api.vehicle.slowDown(vehicle, 0.0, seconds)
            stage.busy.add(vehicle)
            stage.steered.add(vehicle)
            self._turns.append(_Turn(vehicle, lane, back, actors.time_s))
            return True
        return False

    def _carry_on(self, stage: Stage, turn: _Turn) -> bool:
        row = stage.rows.get(turn.vehicle)
        if row is None:
            return False
        now = stage.actors.time_s
        if turn.script is None:
            if now - turn.start_s > _PATIENCE_S or stage.actors.lanes[row] != turn.lane.id:
                return False
            if stage.actors.speed_mps[row] > 0.02:
                return True
            stage.api.vehicle.setSpeed(turn.vehicle, 0.0)
            if not turn.keeper:
                return self._ask_for_room(stage, turn, row)
            return self._start(stage, turn, row) if turn.keeper in stage.api.vehicle.getIDList() else True
        plays = stage.motion.plays(turn.vehicle)
        if not turn.moved and stage.motion.steps_left(turn.vehicle) < _HOLD_STEPS:
            self._change_sides(stage, turn)
        elif turn.moved and stage.actors.lanes[row] == turn.back.id and not plays:
            return False
        return plays or now < turn.start_s + _LONGEST_S

    def _ask_for_room(self, stage: Stage, turn: _Turn, row: int) -> bool:
        """Send a keeper into the other direction."""
        position, heading = stage.actors.front[row, :2], float(stage.actors.heading_rad[row])
        script = self._plan(stage, row, turn.lane, turn.back, position, heading, only_parked=True)
        if script is None:
            return False
        size = stage.actors.size[row]
        ways = in_axes(_boxes(script, size), position, heading)
        reach = np.abs(np.cos(ways[:, 2])) * size[0] / 2 + np.abs(np.sin(ways[:, 2])) * size[1] / 2
        first, last = float((ways[:, 0] - reach).min()), float((ways[:, 0] + reach).max())
        at, _ = turn.back.project(position)
        head, length = at - first + _MARGIN_M, last - first + 2 * _MARGIN_M
        if head > turn.back.length_m - 1 or head - length < 1:
            return False
        api, name = stage.api, f"keeper{next(self._numbers)}"
        api.vehicletype.copy(stage.actors.types[row], name)
        api.vehicletype.setLength(name, length)
        api.vehicletype.setMaxSpeed(name, 0.01)
        api.route.add(name, [turn.back.edge])
        stage.traffic.hide(name)
        api.vehicle.add(name, name, name, "now", str(turn.back.index), f"{head:.2f}", "0")
        turn.keeper = name
        return True

    def _start(self, stage: Stage, turn: _Turn, row: int) -> bool:
        position, heading = stage.actors.front[row, :2], float(stage.actors.heading_rad[row])
        script = self._plan(stage, row, turn.lane, turn.back, position, heading, only_parked=False)
        if script is None:
            return True  # a vehicle is still passing; try again until patience ends
        hold = np.full(_HOLD_STEPS, len(script) - 1)
        rows = np.concatenate([np.arange(len(script)), hold])
        turn.script = Script(script.front[rows], script.heading_rad[rows])
        stage.motion.play(turn.vehicle, turn.script)
        stage.record("u_turn", turn.vehicle)
        return True

    def _plan(
        self,
        stage: Stage,
        row: int,
        lane: Lane,
        back: Lane,
        position: np.ndarray,
        heading: float,
        only_parked: bool,
    ) -> Script | None:
        actors = stage.actors
        _, beside = lane.project(position)
        _, across = back.project(position)
        boxes = stage.boxes_near(position, actors.ids[row])
        boxes = in_axes(boxes, position, heading)
        right = -(lane.width_m / 2 + beside + stage.roads.right_room(lane.edge)) + _KERB_M
        outer = sum(other.width_m for other in stage.roads.of_edge[back.edge]) - back.width_m / 2
        left = across + outer + stage.roads.right_room(back.edge) - _KERB_M
        if only_parked:
            boxes = boxes[(boxes[:, 1] < beside - lane.width_m / 2) | (boxes[:, 1] > left - 2.2)]
        for over in (0.0, _OVER_KERB_M):
            room = Room(right_m=right - over, left_m=left + over, goal_m=across, boxes=boxes)
            try:
                return plan_turn(position, heading, actors.kinds[row], actors.size[row], room, stage.step_s)
            except TurnError:
                continue
        return None

    def _change_sides(self, stage: Stage, turn: _Turn) -> None:
        script = turn.script
        assert script is not None
        api = stage.api.vehicle
        if turn.keeper:
            api.remove(turn.keeper)
            turn.keeper = ""
        angle = float(90.0 - np.degrees(script.heading_rad[-1])) % 360.0
        at, _ = turn.back.project(script.front[-1])
        spot, _ = turn.back.point(at)
        api.moveToXY(turn.vehicle, turn.back.edge, turn.back.index, float(spot[0]), float(spot[1]), angle, 0)
        api.setSpeed(turn.vehicle, 0.0)
        turn.moved = True

    def _end(self, stage: Stage, turn: _Turn) -> None:
        self._turns.remove(turn)
        stage.busy.discard(turn.vehicle)
        stage.steered.discard(turn.vehicle)
        api = stage.api.vehicle
        if turn.keeper:
            api.remove(turn.keeper)
        if turn.vehicle not in stage.rows:
            return
        if turn.moved:
            route = wander(stage, turn.vehicle, turn.back.edge, self._rng)
            if route is not None:
                api.setRoute(turn.vehicle, route)
        api.setSpeed(turn.vehicle, -1)


def _boxes(script: Script, size: np.ndarray) -> np.ndarray:
    heading = script.heading_rad
    centre = script.front - size[0] / 2 * unit_vectors(heading)
    return np.column_stack([centre, heading, np.tile(size[:2], (len(script), 1))])


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
            if row is not None and plays and stage.motion.stuck_s()[row] > _STUCK_ACROSS_S and stage.take_away(vehicle):
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
        for right, left in _TURNAROUND_ROOMS_M:
            room = Room(right_m=-right, left_m=max(left, goal + 1.5), goal_m=goal, boxes=_NOBODY)
            try:
                script = plan_turn(position, heading, actors.kinds[row], actors.size[row], room, stage.step_s)
            except TurnError:
                continue
            stage.motion.play(vehicle, script)
            stage.api.vehicle.setSpeed(vehicle, _TURNAROUND_MPS)
            stage.busy.add(vehicle)
            stage.steered.add(vehicle)
            self._turning[vehicle] = back
            return
