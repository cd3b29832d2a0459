"""Rear-end collisions of drivers who brake too late for a stopped vehicle, and contacts that no collision explains."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cosim.traffic.behaviour.stage import Stage
from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion import overlaps

_GAP_M = (6.0, 30.0)
_SPEED_MPS = (3.5, 10.0)
_LONGEST_M = 6.0
_STANDS_MPS = 0.2
_DENT_M = 0.12
_BRAKES_MPS2 = 6.0
_LEAVES_LATER_S = 4.0
_LONGEST_S = 15.0  # until they touch
_CAREFUL, _BLIND = 31, 0  # SUMO's speed modes: all checks, none
_CONTACT_FORGOTTEN_S = 10.0


@dataclass(eq=False)
class _Crash:
    driver: str
    victim: str
    stands_s: float
    start_s: float
    until_s: float | None = None


class Collisions:
    """At random times a driver misjudges the gap and hits the car in front; both then block the lane for a while.

    He brakes along v² = 2b(g + d), so that he comes to rest d = 0.12 m inside the other's rear; contact is at
    v = √(2bd), walking speed.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._due = 0
        self._crashes: list[_Crash] = []

    def step(self, stage: Stage) -> None:
        """Choose the drivers that collide, control them until the collision, and release them afterwards."""
        self._due = min(self._due + stage.due(stage.config.collisions_per_min, self._rng), 3)
        if self._due and round(stage.actors.time_s / stage.step_s) % 5 == 0:
            self._due -= self._begin(stage)
        for crash in list(self._crashes):
            if not self._carry_on(stage, crash):
                self._end(stage, crash)

    def _begin(self, stage: Stage) -> bool:
        queues: dict[str, list[int]] = {}
        actors = stage.actors
        for row, lane in enumerate(actors.lanes):
            if lane and lane[0] != ":" and lane in stage.roads.lanes and not actors.parked[row]:
                queues.setdefault(lane, []).append(row)
        found = []
        for rows in queues.values():
            rows.sort(key=lambda row: actors.lane_position_m[row])
            found += [pair for pair in pairwise(rows) if self._fits(stage, *pair)]
        if not found:
            return False
        row, ahead = found[int(self._rng.integers(len(found)))]
        crash = _Crash(
            actors.ids[row], actors.ids[ahead], stage.config.collision_stands_s.draw(self._rng), actors.time_s
        )
        stage.busy |= {crash.driver, crash.victim}
        stage.steered |= {crash.driver, crash.victim}
        stage.motion.let_touch(crash.driver, crash.victim)
        stage.api.vehicle.setSpeedMode(crash.driver, _BLIND)
        stage.api.vehicle.setLaneChangeMode(crash.driver, 0)
        stage.api.vehicle.setSpeed(crash.victim, 0.0)
        self._crashes.append(crash)
        return True

    def _fits(self, stage: Stage, row: int, ahead: int) -> bool:
        actors = stage.actors
        names = {actors.ids[row], actors.ids[ahead]}
        if names & stage.exempt or any(map(stage.engaged, names)):
            return False
        if {actors.kinds[row], actors.kinds[ahead]} - {"car", "van"}:
            return False
        gap = _gap(stage, row, ahead)
        fast = _SPEED_MPS[0] < actors.speed_mps[row] < _SPEED_MPS[1]
        longest = max(actors.size[row, 0], actors.size[ahead, 0])
        stands = actors.speed_mps[ahead] < _STANDS_MPS and longest < _LONGEST_M
        stopping = actors.speed_mps[row] ** 2 / (2 * _BRAKES_MPS2)
        return bool(fast and stands and max(_GAP_M[0], stopping) < gap < _GAP_M[1])

    def _carry_on(self, stage: Stage, crash: _Crash) -> bool:
        row, ahead = stage.rows.get(crash.driver), stage.rows.get(crash.victim)
        if row is None or ahead is None:
            return False
        actors, api = stage.actors, stage.api
        depth_m = _depth(stage, row, ahead)
        if depth_m >= _DENT_M:
            stage.motion.keep_apart(crash.driver, crash.victim)  # no deeper, wherever SUMO has them
        if crash.until_s is None:
            late = actors.time_s > crash.start_s + _LONGEST_S
            if late or actors.lanes[row] != actors.lanes[ahead]:
                return False
            if depth_m > 0:
                stage.record("collision", crash.driver, crash.victim)
                stage.collided.add((min(crash.driver, crash.victim), max(crash.driver, crash.victim)))
                crash.until_s = actors.time_s + crash.stands_s
        elif actors.time_s >= crash.until_s:
            api.vehicle.setSpeed(crash.victim, -1)
            return actors.time_s < crash.until_s + _LEAVES_LATER_S
        gap = _gap(stage, row, ahead)
        ease = _BRAKES_MPS2 * stage.step_s
        speed = -ease + np.sqrt(ease**2 + 2 * _BRAKES_MPS2 * max(gap + _DENT_M, 0.0))
        api.vehicle.setSpeed(crash.driver, float(min(speed, _SPEED_MPS[1], max(actors.speed_mps[row], 1.0))))
        return True

    def _end(self, stage: Stage, crash: _Crash) -> None:
        self._crashes.remove(crash)
        stage.busy -= {crash.driver, crash.victim}
        stage.steered -= {crash.driver, crash.victim}
        stage.motion.keep_apart(crash.driver, crash.victim)
        for vehicle in (crash.driver, crash.victim):
            if vehicle in stage.rows:
                stage.api.vehicle.setSpeed(vehicle, -1)
                stage.api.vehicle.setSpeedMode(vehicle, _CAREFUL)
                stage.api.vehicle.setLaneChangeMode(vehicle, 1621)


def _gap(stage: Stage, row: int, ahead: int) -> float:
    actors = stage.actors
    return float(actors.lane_position_m[ahead] - actors.size[ahead, 0] - actors.lane_position_m[row])


def _depth(stage: Stage, row: int, ahead: int) -> float:
    """Penetration depth of the bodies of two vehicles [m]."""
    rows, actors = [row, ahead], stage.actors
    heading = actors.heading_rad[rows]
    forward = unit_vectors(heading)
    centre = actors.front[rows, :2] - forward * actors.size[rows, :1] / 2
    return float(overlaps(centre, heading, actors.size[rows]).depth_m.max(initial=0.0))


class Contacts:
    """Records pairs of vehicles whose boxes start to overlap, except configured collisions; moving ones stop there.

    Motion keeps bodies apart, so this records what it could not foresee: two who enter the simulation in each other.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._last_s: dict[tuple[str, str], float] = {}
        self._stands: dict[str, float] = {}  # until

    def step(self, stage: Stage) -> None:
        """Look at all boxes."""
        actors = stage.actors
        rows = np.flatnonzero(np.array([kind != "pedestrian" for kind in actors.kinds], bool))
        heading = actors.heading_rad[rows]
        forward = unit_vectors(heading)
        centre = actors.front[rows, :2] - forward * actors.size[rows, :1] / 2
        found = overlaps(centre, heading, actors.size[rows])
        for i, j in zip(rows[found.first].tolist(), rows[found.second].tolist(), strict=True):
            if abs(actors.speed_mps[i]) < abs(actors.speed_mps[j]):
                i, j = j, i
            self._meet(stage, i, j)
        for vehicle, until in list(self._stands.items()):
            if actors.time_s >= until:
                del self._stands[vehicle]
                stage.steered.discard(vehicle)
                if vehicle in stage.rows:
                    stage.api.vehicle.setSpeed(vehicle, -1)

    def _meet(self, stage: Stage, i: int, j: int) -> None:
        one, other = stage.actors.ids[i], stage.actors.ids[j]
        key, now = (min(one, other), max(one, other)), stage.actors.time_s
        last = self._last_s.get(key, -np.inf)
        self._last_s[key] = now
        if now - last < _CONTACT_FORGOTTEN_S or key in stage.collided:
            return
        stage.record("contact", one, other)
        stands_s = stage.config.collision_stands_s.draw(self._rng)
        for row in (i, j):
            vehicle = stage.actors.ids[row]
            if not stage.actors.parked[row] and vehicle not in stage.busy:
                stage.api.vehicle.setSpeed(vehicle, 0.0)
                stage.steered.add(vehicle)
                self._stands[vehicle] = now + stands_s
