"""Actions of drivers other than car following: lane changes without a reason, U-turns, pull-outs.

SUMO's own drivers do everything else; these acts are decided twice a second.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from cosim.driver_discrepancy.settings import DEFAULT
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.behaviour.distributions import Constant
from cosim.traffic.behaviour.habits import Habits, draw_habits
from cosim.traffic.behaviour.roads import Lane, Roads
from cosim.traffic.behaviour.vehicle_parameters import set_parameters

_BY = DEFAULT.simulating
_ACTS_EVERY_S = 0.5
_ON_FOOT = ("pedestrian", "bicycle", "scooter")


def needs_steps(behaviour: BehaviourConfig) -> bool:
    """Whether a behaviour has acts that SUMO's vTypes cannot express."""
    share = behaviour.lane_change_share
    changes = not (isinstance(share, Constant) and share.value == 0) and share.bounds[1] > 0
    return changes or behaviour.u_turns_per_min > 0 or behaviour.pull_outs_per_min > 0


@dataclass(eq=False)
class _SimulatedDriver:
    habits: Habits
    rng: np.random.Generator
    edge: str = ""
    wish: tuple[str, float, int] | None = None  # lane, position along it, lane index wanted


@dataclass(frozen=True)
class _SimulatedTurn:
    lane: Lane
    back: Lane
    until_s: float


@dataclass(frozen=True, eq=False)
class _Snapshot:
    """Vehicles at a time: names, lanes, positions along them [m], speeds [m/s], places (n, 2) [m], who is parked."""

    time_s: float
    ids: tuple[str, ...]
    lanes: tuple[str, ...]
    lane_position_m: np.ndarray
    speed_mps: np.ndarray
    front: np.ndarray
    parked: np.ndarray


class Driving:
    """Applies the drivers' actions step by step. Equal seeds give each driver the same draws with any configuration.

    Args:
        sumo: the running libsumo, not yet stepped.
        config: how drivers behave; collisions and pull-ins are left out.
        seed: of all draws.
        seconds: how long the simulation lasts.
        step_s: of the simulation [s].
        sets_parameters: whether vTypes do not have the drivers' parameters already.
        prolong: gives a vehicle a longer route, with the draws of a generator; None: routes are long enough.
    """

    def __init__(
        self,
        sumo: ModuleType,
        config: BehaviourConfig,
        seed: int,
        seconds: float,
        step_s: float,
        *,
        sets_parameters: bool = True,
        prolong: Callable[[str, np.random.Generator], None] | None = None,
    ) -> None:
        self._sumo, self._config, self._seed = sumo, config, seed
        self._step_s, self._sets_parameters, self._prolong = step_s, sets_parameters, prolong
        self._roads = Roads(sumo)
        self._drivers: dict[str, _SimulatedDriver] = {}
        self._turns: dict[str, _SimulatedTurn] = {}
        self._ways = np.random.default_rng([seed, 1])
        begin = float(sumo.simulation.getTime())
        self._u_turns = _schedule(config.u_turns_per_min, begin, seconds, np.random.default_rng([seed, 2]))
        self._pull_outs = _schedule(config.pull_outs_per_min, begin, seconds, np.random.default_rng([seed, 3]))
        self._onward_s = self._acts_s = begin

    def step(self) -> None:
        """Act after a step, if it is time to."""
        if self._sets_parameters:
            for name in self._sumo.simulation.getDepartedIDList():
                self._drivers[name] = self._begin(name)
        time_s = float(self._sumo.simulation.getTime())
        if time_s < self._acts_s - 1e-6:
            return
        self._acts_s = time_s + _ACTS_EVERY_S
        actors = self._snapshot(time_s)
        for row, (name, lane) in enumerate(zip(actors.ids, actors.lanes, strict=True)):
            if lane and not actors.parked[row]:
                self._drive(actors, row, name, lane)
        if self._prolong is not None and time_s >= self._onward_s:
            self._onward_s += _BY.onward_every_s
            for name, lane in zip(actors.ids, actors.lanes, strict=True):
                if name in self._drivers and lane and name not in self._turns:
                    self._prolong(name, self._ways)
        if self._pull_outs and time_s >= self._pull_outs[0][0]:
            self._pull_out(actors, self._pull_outs.pop(0)[1])
        if self._u_turns and time_s >= self._u_turns[0][0]:
            self._begin_turn(actors, self._u_turns.pop(0)[1])
        for name in list(self._turns):
            self._turn(actors, name)

    def _snapshot(self, time_s: float) -> _Snapshot:
        api = self._sumo.vehicle
        ids = tuple(name for name in sorted(api.getIDList()) if api.getVehicleClass(name) not in _ON_FOOT)
        return _Snapshot(
            time_s,
            ids,
            tuple(api.getLaneID(name) for name in ids),
            np.array([api.getLanePosition(name) for name in ids], float),
            np.array([api.getSpeed(name) for name in ids], float),
            np.array([api.getPosition(name) for name in ids], float).reshape(-1, 2),
            np.array([api.isStoppedParking(name) for name in ids], bool),
        )

    def _drive(self, actors: _Snapshot, row: int, name: str, lane: str) -> None:
        driver = self._drivers.get(name)
        if driver is None:
            driver = self._drivers[name] = self._begin(name)
        here = self._roads.lanes.get(lane)
        if here is None or lane[0] == ":":
            return
        if here.edge != driver.edge:
            driver.edge = here.edge
            if self._sets_parameters and self._config.speeding_share is not None:
                factor = driver.habits.speed_factor(here.limit_mps)
                self._sumo.vehicle.setSpeedFactor(name, max(factor, 0.1))
            driver.wish = self._wish(driver, here)
        if driver.wish is not None and name not in self._turns:
            wanted, position, index = driver.wish
            if lane != wanted:
                driver.wish = None
            elif actors.lane_position_m[row] > position and actors.speed_mps[row] > 2:
                driver.wish = None
                self._sumo.vehicle.changeLane(name, index, _BY.lane_held_s)

    def _begin(self, name: str) -> _SimulatedDriver:
        habits, api = draw_habits(self._config, self._seed, name), self._sumo.vehicle
        if self._sets_parameters and api.getVehicleClass(name) not in _ON_FOOT:
            set_parameters(api, name, habits, self._step_s)
            if self._config.speeding_share is None and habits.speed_ratio != 1.0:
                api.setSpeedFactor(name, api.getSpeedFactor(name) * habits.speed_ratio)
        return _SimulatedDriver(habits, self._luck_of(name))

    def _luck_of(self, name: str) -> np.random.Generator:
        return np.random.default_rng([self._seed, 4, zlib.crc32(name.encode())])

    def _wish(self, driver: _SimulatedDriver, here: Lane) -> tuple[str, float, int] | None:
        left, right, at, which = driver.rng.random(4).tolist()
        beside = {lane.index for lane in self._roads.of_edge[here.edge]}
        chances = ((1, driver.habits.changes_left, left), (-1, driver.habits.changes_right, right))
        wishes = [here.index + side for side, chance, luck in chances if here.index + side in beside and luck < chance]
        if not wishes or here.length_m < 2 * _BY.turn_clear_of_ends_m:
            return None
        position = 0.1 * here.length_m + at * (0.9 * here.length_m - _BY.turn_clear_of_ends_m)
        return here.id, position, wishes[int(which * len(wishes))]

    def _pull_out(self, actors: _Snapshot, luck: float) -> None:
        """Let one of those who are parked go."""
        parked = [actors.ids[row] for row in np.flatnonzero(actors.parked).tolist()]
        if parked:
            name = parked[int(luck * len(parked))]
            if self._send(name, self._sumo.vehicle.getRoute(name)[0]):
                self._sumo.vehicle.resume(name)

    def _send(self, name: str, edge: str) -> bool:
        """A way from an edge to somewhere; whether there is one."""
        api = self._sumo
        vtype, edges = api.vehicle.getTypeID(name), sorted(self._roads.of_edge)
        edges = [one for one in edges if one[0] != ":"]
        for _ in range(_BY.ways_tried):
            target = edges[int(self._ways.integers(len(edges)))]
            way = api.simulation.findRoute(edge, target, vtype).edges
            if len(way) > 2:
                api.vehicle.setRoute(name, way)
                return True
        return False

    def _begin_turn(self, actors: _Snapshot, luck: float) -> None:
        """Make a vehicle on the innermost lane brake for a U-turn."""
        found = []
        for row, (name, lane) in enumerate(zip(actors.ids, actors.lanes, strict=True)):
            here = self._roads.lanes.get(lane)
            if here is None or lane[0] == ":" or name in self._turns or name not in self._drivers:
                continue
            stop = actors.lane_position_m[row] + actors.speed_mps[row] ** 2 / (2 * _BY.turn_brakes_mps2)
            inner = here is self._roads.of_edge[here.edge][-1] and here.edge in self._roads.back
            inner &= _BY.turn_clear_of_ends_m < stop < here.length_m - _BY.turn_clear_of_ends_m
            if inner and actors.speed_mps[row] > 1 and not actors.parked[row]:
                found.append((row, here))
        if found:
            row, here = found[int(luck * len(found))]
            back = self._roads.of_edge[self._roads.back[here.edge]][-1]
            name, seconds = actors.ids[row], max(float(actors.speed_mps[row]) / _BY.turn_brakes_mps2, 1.0)
            self._sumo.vehicle.slowDown(name, 0.0, seconds)
            self._turns[name] = _SimulatedTurn(here, back, actors.time_s + _BY.turn_waits_s)

    def _turn(self, actors: _Snapshot, name: str) -> None:
        turn, api = self._turns[name], self._sumo.vehicle
        row = actors.ids.index(name) if name in actors.ids else -1
        lane = actors.lanes[row] if row >= 0 else ""
        if lane == turn.back.id and turn.lane.id != turn.back.id:
            self._send(name, turn.back.edge)
        if lane != turn.lane.id or actors.time_s > turn.until_s:
            del self._turns[name]
            if row >= 0:
                api.setSpeed(name, -1)
        elif actors.speed_mps[row] <= DEFAULT.placing.rests_mps:
            self._move_over(actors, name, row, turn)

    def _move_over(self, actors: _Snapshot, name: str, row: int, turn: _SimulatedTurn) -> None:
        """Move a stopped vehicle to the other side if there is room; it continues from there."""
        api = self._sumo.vehicle
        api.setSpeed(name, 0.0)
        at, _ = turn.back.project(actors.front[row, :2])
        there = [i for i, lane in enumerate(actors.lanes) if lane == turn.back.id and not actors.parked[i]]
        if all(not -_BY.turn_room_m[0] < actors.lane_position_m[i] - at < _BY.turn_room_m[1] for i in there):
            spot, heading = turn.back.point(at)
            angle = float(90 - np.degrees(heading)) % 360
            api.moveToXY(name, turn.back.edge, turn.back.index, float(spot[0]), float(spot[1]), angle, 0)


def _schedule(per_min: float, begin_s: float, seconds: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Times and luck of incidents: a thinned Poisson process, so that a greater rate keeps those of a smaller one."""
    count = rng.poisson(_BY.most_per_min * seconds / 60)
    times, keep, luck = rng.uniform(begin_s, begin_s + seconds, count), rng.random(count), rng.random(count)
    chosen = np.flatnonzero(keep < per_min / _BY.most_per_min)
    return sorted(zip(times[chosen].tolist(), luck[chosen].tolist(), strict=True))
