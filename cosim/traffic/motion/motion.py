"""Between SUMO and the bridge: road users that move as bodies do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion import drift
from cosim.traffic.motion.approach import Approach
from cosim.traffic.motion.bicycle import BicycleState, follow, wrap
from cosim.traffic.motion.body import Springs
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.footsteps import APART_M, Footsteps
from cosim.traffic.motion.rails import roll
from cosim.traffic.motion.script import Player, Script
from cosim.traffic.motion.steps import Company, take_steps
from cosim.traffic.motion.trail import Trail
from cosim.traffic.motion.velocity import velocities
from cosim.traffic.motion.walking import walk

_COURSE_GAIN, _TRAVELS_M = 0.3, 0.02
_STANDS_MPS = 0.1
_BESIDE_M = 0.3  # who is nearer to the end of that way is there, or past it
_LATE_M = 0.5  # a bumper so far behind its target drives after it on the way the target took
_CATCHES_UP_MPS2, _CREEPS_MPS = 2.0, 0.5
_ASIDE_M = 6.0  # distance over which a vehicle returns after an evasive movement
_LOOKS_M = 1.0  # along that way
_STATE = {"front": 2, "raw": 2, "velocity": 2, "noted": 2, "springs": 4}
_STATE |= dict.fromkeys(
    ("heading", "curvature", "speed", "course", "travel", "raw_heading", "waits", "stuck", "behind", "aside"), 1
)
_STATE |= dict.fromkeys(("jump", "jump_at", "jump_length", "jump_steep", "lane_offset", "along", "way", "known"), 1)


class Motion:
    """Smooths all road users step by step; all steps of an episode, warm-up included, must pass through it.

    Vehicles are rear-axle bicycles whose front bumpers follow SUMO's; where SUMO's position jumps sideways they move
    over gradually; scripts override both. Trams keep both bogies on the line that SUMO's take. Who would touch another
    waits (`cosim.traffic.motion.guard`). People on foot follow with limited acceleration. Parked vehicles do not move.

    Args:
        step_s: SUMO's step length.
    """

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self._springs = Springs(step_s)
        self._ids: tuple[str, ...] = ()
        self._rows: dict[str, int] = {}
        self._of: dict[str, np.ndarray] = {
            name: np.zeros((0, width) if width > 1 else 0) for name, width in _STATE.items()
        }
        self._chassis = Chassis.of((), np.zeros(0))
        self._walks = np.zeros(0, bool)
        self._lane_offsets: dict[str, float] = {}
        self._players: dict[str, Player] = {}
        self._may_touch: set[tuple[str, str]] = set()
        self._blocks: dict[str, str] = {}
        self._approaches: dict[str, Approach] = {}
        self._exits: dict[str, float] = {}
        self._trails: dict[str, Trail] = {}
        self._footsteps: dict[str, Footsteps] = {}

    def poses(self, actors: Actors) -> tuple[np.ndarray, np.ndarray]:
        """Front bumpers (n, 2) and headings (n,) after the last step; for those it did not know, as the actors say."""
        front, heading = actors.front[:, :2].copy(), actors.heading_rad.copy()
        rows = np.array([self._rows.get(name, -1) for name in actors.ids], int)
        known = rows >= 0
        front[known], heading[known] = self._of["front"][rows[known]], self._of["heading"][rows[known]]
        return front, heading

    def keep_offset(self, vehicle: str, offset_m: float) -> None:
        """Set a vehicle's lateral offset from the lane's centre line, positive to the left."""
        self._lane_offsets[vehicle] = offset_m
        if vehicle in self._rows:
            self._of["lane_offset"][self._rows[vehicle]] = offset_m

    def offset(self, vehicle: str) -> float:
        """Lateral offset of a vehicle from the centre line of its lane, positive to the left [m]."""
        return self._lane_offsets.get(vehicle, 0.0)

    def play(self, vehicle: str, script: Script) -> None:
        """Let a vehicle move by a script from the next step on, whatever SUMO does with it."""
        row = self._rows[vehicle]
        self._players[vehicle] = Player(script, self._of["front"][row], float(self._of["heading"][row]))

    def back_up(self, vehicle: str, way_m: float, hold_s: float, aside_m: float) -> bool:
        """Let a vehicle go back the way it came, rest, and come again so far to the left; whether it can.

        It continues as before if a vehicle is behind it.
        """
        row = self._rows[vehicle]
        front, heading = self._of["front"][row], float(self._of["heading"][row])
        footsteps = self._footsteps.get(vehicle)
        script = footsteps and footsteps.back(front, heading, way_m, round(hold_s / self._step_s))
        if footsteps is None or script is None or vehicle in self._players:
            return False
        footsteps.clear()
        self._of["noted"][row] = np.nan
        self._players[vehicle] = Player(script, front, heading, retreat=True)
        self._of["aside"][row] = aside_m
        return True

    def plays(self, vehicle: str) -> bool:
        """Whether a script still runs."""
        return vehicle in self._players

    def steps_left(self, vehicle: str) -> float:
        """Smallest number of steps that a vehicle's script still takes."""
        return self._players[vehicle].steps_left if vehicle in self._players else 0.0

    def let_touch(self, one: str, other: str) -> None:
        """Allow two vehicles to collide, until this is revoked."""
        self._may_touch.add((one, other))

    def keep_apart(self, one: str, other: str) -> None:
        """Take back `let_touch`."""
        self._may_touch.discard((one, other))

    def waits_s(self) -> np.ndarray:
        """For how long everyone could not go where SUMO wants him (n,) [s]; zero for those who can."""
        return self._of["waits"]

    def blocker(self, vehicle: str) -> str | None:
        """Vehicle that blocked a vehicle in the last step."""
        return self._blocks.get(vehicle)

    def stuck_s(self) -> np.ndarray:
        """(n,) time [s] for which each vehicle has been stationary although SUMO's position is elsewhere."""
        return self._of["stuck"]

    def lag(self) -> np.ndarray:
        """Distance (n,) [m] of moving vehicles from SUMO's positions, without their lateral offsets."""
        of = self._of
        meant = np.abs(of["jump"])
        meant[[self._rows[name] for name in self._approaches.keys() & self._rows.keys()]] += 4.0
        return np.where(self._walks, 0.0, np.maximum(_length(of["raw"] - of["front"]) - meant, 0.0))

    def behind(self) -> np.ndarray:
        """(n,) distance [m] of each vehicle behind SUMO's position along SUMO's path; zero next to it."""
        return self._of["behind"]

    def approach(self, vehicle: str, approach: Approach) -> None:
        """Let a vehicle move over to a parking place while SUMO takes it there along the lane."""
        self._approaches[vehicle] = approach

    def leave_steeply(self, vehicle: str, length_m: float) -> None:
        """Let the next sideways jump of a vehicle be driven within a length, beginning with the wheels turned."""
        self._exits[vehicle] = length_m

    def update(self, actors: Actors) -> Actors:
        """The actors as they move after one more step.

        Returns:
            The same rows. `speed_mps` and `lateral_mps` together are the velocity of the box's centre over the last
            step, `yaw_rate_radps` that of the heading, `acceleration_mps2` the change of `speed_mps`.
        """
        if actors.ids != self._ids:
            self._remap(actors)
        of, step = self._of, self._step_s
        raw, raw_heading = actors.front[:, :2], actors.heading_rad
        fresh = of["known"] == 0
        self._enter(actors, np.flatnonzero(fresh))
        before, heading_before = of["front"].copy(), of["heading"].copy()
        self._end_scripts()

        of["jump"][actors.parked] = 0.0
        drives = np.flatnonzero(~self._walks & ~actors.parked)
        self._take_steps(actors, drives, self._wanted(actors, drives))
        walks = np.flatnonzero(self._walks)
        of["front"][walks], of["velocity"][walks], of["heading"][walks] = walk(
            before[walks], of["velocity"][walks], heading_before[walks], raw[walks], raw_heading[walks], step
        )
        of["raw"], of["raw_heading"] = raw.copy(), raw_heading.copy()
        return self._report(actors, before, heading_before, fresh)

    def _wanted(self, actors: Actors, rows: np.ndarray) -> BicycleState:
        """The state that takes those who drive after SUMO's places."""
        of = self._of
        raw, raw_heading = actors.front[rows, :2], actors.heading_rad[rows]
        moved = raw - of["raw"][rows]
        distance = actors.speed_mps[rows] * self._step_s
        chord = of["raw_heading"][rows] + wrap(raw_heading - of["raw_heading"][rows]) / 2
        chassis = self._chassis.take(rows)
        jump = np.where(chassis.on_rails, 0.0, drift.lateral_jump(moved, chord, distance))
        for i in np.flatnonzero(jump):
            self._take_up_jump(actors, int(rows[i]), float(jump[i]))
        along = np.where(jump != 0, 0.0, _length(moved))
        of["way"][rows] += distance
        of["jump_at"][rows] += np.where(jump != 0, distance, along)

        travels = (along > _TRAVELS_M) & (jump == 0)
        travel = np.where(travels, np.arctan2(moved[:, 1], moved[:, 0]), of["travel"][rows])
        travel = np.where(jump != 0, raw_heading, travel)
        of["travel"][rows] = travel
        gain = np.where(travels, _COURSE_GAIN, 0.0)
        course = wrap(of["course"][rows] + gain * wrap(raw_heading - of["course"][rows]))
        of["course"][rows] = course

        offset, slope = self._offset(rows)
        left = np.column_stack([-np.sin(course), np.cos(course)])
        target = raw + offset[:, None] * left
        state = BicycleState(of["front"][rows], of["heading"][rows], of["curvature"][rows], of["speed"][rows])
        travel = travel + np.arctan(slope)
        course = raw_heading.copy()
        trails = self._go_on_trails(actors, rows, target)
        late = _length(target - state.front) - state.speed_mps * self._step_s > _LATE_M
        of["behind"][:] = 0.0
        paces = np.full(len(rows), np.nan)
        for i in np.flatnonzero(late | (chassis.guide_m > 0)).tolist():
            guide, behind = float(chassis.guide_m[i]), 0.0
            heading, speed = state.heading_rad[i], float(state.speed_mps[i])
            point = state.front[i] - guide * np.array([np.cos(heading), np.sin(heading)])
            left = trails[i].nearest(point) - guide if late[i] else 0.0
            if left > _BESIDE_M:
                top = float(actors.speed_mps[rows[i]]) + np.sqrt(2 * _CATCHES_UP_MPS2 * left)
                paces[i] = max(min(speed + _CATCHES_UP_MPS2 * self._step_s, top), _CREEPS_MPS)
                behind = max(left - paces[i] * self._step_s - _LOOKS_M, 0.0)
                of["behind"][rows[i]] = left
            target[i], travel[i] = trails[i].behind(guide + behind)
            target[i] += of["aside"][rows[i]] * np.array([-np.sin(travel[i]), np.cos(travel[i])])
            course[i] = travel[i] if behind > 0 else course[i]
        wanted = follow(state, chassis, target, course, travel, self._step_s, paces)
        for i in np.flatnonzero(chassis.on_rails).tolist():
            of["behind"][rows[i]] = roll(wanted, state, i, chassis, trails[i], self._step_s)
        return wanted

    def _take_steps(self, actors: Actors, drives: np.ndarray, wanted: BicycleState) -> None:
        """Move all road users, except where bodies would touch."""
        of, step = self._of, self._step_s
        # whom SUMO's vehicles do not know of
        stands = self._walks & np.array([not lane for lane in actors.lanes], bool)
        wheels = np.flatnonzero(~self._walks | stands)
        on_foot = stands[wheels]
        state = {name: of[name][wheels].copy() for name in ("front", "heading", "curvature", "speed")}
        state["curvature"][actors.parked[wheels]] = state["speed"][actors.parked[wheels]] = 0.0
        state["speed"][on_foot] = state["curvature"][on_foot] = 0.0
        state["front"][on_foot] += _bumpers(actors, of["heading"], wheels[on_foot])
        row_of = np.full(len(actors), -1)  # in `wheels`
        row_of[wheels] = np.arange(len(wheels))
        want, index = {name: values.copy() for name, values in state.items()}, row_of[drives]
        want["front"][index], want["heading"][index] = wanted.front, wanted.heading_rad
        want["curvature"][index], want["speed"][index] = wanted.curvature_per_m, wanted.speed_mps
        company = Company(
            state=state,
            want=want,
            chassis=self._chassis.take(wheels),
            size=actors.size[wheels],
            stuck_s=of["stuck"][wheels],
            players={int(row_of[self._rows[name]]): player for name, player in self._players.items()},
            may_touch=self._allowed(row_of),
        )
        taken, waits, blocks = take_steps(company, step)
        self._blocks = {actors.ids[wheels[i]]: actors.ids[wheels[j]] for i, j in blocks.items()}
        rolls = wheels[~on_foot]
        for name, values in taken.items():
            of[name][rolls] = values[~on_foot]
        of["aside"][wheels] *= np.exp(-np.abs(taken["speed"]) * step / _ASIDE_M)
        self._note_footsteps(actors, rolls[~actors.parked[rolls]])
        of["waits"][wheels] = np.where(waits, of["waits"][wheels] + step, 0.0)
        stays = waits & (taken["speed"] < _STANDS_MPS)
        stuck = of["stuck"][wheels]
        of["stuck"][wheels] = np.where(waits, stuck + step * stays, np.maximum(stuck - 2 * step, 0.0))

    def _note_footsteps(self, actors: Actors, rows: np.ndarray) -> None:
        of = self._of
        rows = rows[~(_length(of["front"][rows] - of["noted"][rows]) <= APART_M)]
        fronts, headings = of["front"][rows].tolist(), of["heading"][rows].tolist()
        for row, front, heading in zip(rows.tolist(), fronts, headings, strict=True):
            name = actors.ids[row]
            if name not in self._players:
                self._footsteps.setdefault(name, Footsteps()).add(front[0], front[1], heading)
                of["noted"][row] = front

    def _allowed(self, row_of: np.ndarray) -> frozenset[tuple[int, int]]:
        """Pairs of wheeled rows that may touch."""
        known = [pair for pair in self._may_touch if self._rows.keys() >= set(pair)]
        rows = [(int(row_of[self._rows[a]]), int(row_of[self._rows[b]])) for a, b in known]
        return frozenset((min(pair), max(pair)) for pair in rows if min(pair) >= 0)

    def _go_on_trails(self, actors: Actors, rows: np.ndarray, target: np.ndarray) -> list[Trail]:
        """Trails of the targets of some rows, which are their newest places."""
        trails = []
        for row, position in zip(rows.tolist(), target.tolist(), strict=True):
            trail = self._trails.get(actors.ids[row])
            if trail is None:
                reach_m = float(actors.size[row, 0]) if self._chassis.on_rails[row] else 0.0
                trail = Trail(np.array(position), float(actors.heading_rad[row]), reach_m)
                self._trails[actors.ids[row]] = trail
            trail.add(*position)
            trails.append(trail)
        return trails

    def _offset(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lateral offsets (m,) from SUMO's line and their change per metre of way."""
        of = self._of

        aside = of["lane_offset"][rows]
        offset, slope = np.zeros(len(rows)), np.zeros(len(rows))
        changing = np.flatnonzero((of["jump"][rows] != 0) & (of["jump_at"][rows] - 0.1 < of["jump_length"][rows]))
        if len(changing):
            jump, at, length, is_steep = (
                of[name][rows[changing]] for name in ("jump", "jump_at", "jump_length", "jump_steep")
            )

            def left_over(at: np.ndarray) -> np.ndarray:
                share = at / np.maximum(length, 1e-6)
                return jump * np.where(is_steep > 0, drift.steep(share), drift.smooth(share))

            offset[changing] = left_over(at)
            slope[changing] = (left_over(at + 0.1) - left_over(at - 0.1)) / 0.2
        for vehicle, approach in self._approaches.items():
            row = self._rows.get(vehicle)
            hit = np.flatnonzero(rows == row) if row is not None else ()
            for i in hit:
                away = of["raw"][row] - approach.stop
                over, change = approach.over(float(np.hypot(*away) - self._step_s * of["speed"][row]))
                offset[i] += (approach.offset_m - aside[i]) * over
                slope[i] += (approach.offset_m - aside[i]) * change
        return offset + aside, slope

    def _take_up_jump(self, actors: Actors, row: int, jump_m: float) -> None:
        """Keep the place on the road: what SUMO jumps, the offset takes back."""
        of, vehicle = self._of, actors.ids[row]
        if vehicle in self._players:
            return
        offset, _ = self._offset(np.array([row]))
        of["jump"][row] = offset[0] - of["lane_offset"][row] - jump_m
        if vehicle in self._approaches:
            del self._approaches[vehicle]
        steep = self._exits.pop(vehicle, None)
        if steep is not None:
            self._trails.pop(vehicle, None)
        of["jump_at"][row] = 0.0
        of["jump_steep"][row] = 0.0 if steep is None else 1.0
        of["jump_length"][row] = float(drift.change_length(actors.speed_mps[[row]])[0]) if steep is None else steep

    def _end_scripts(self) -> None:
        """Those who have played theirs, or have left, drive themselves again."""
        for vehicle, player in list(self._players.items()):
            row = self._rows.get(vehicle)
            if row is None or player.steps_left <= 0:
                del self._players[vehicle]
                if player.retreat:
                    continue
                self._trails.pop(vehicle, None)
                self._footsteps.pop(vehicle, None)
                if row is not None:
                    self._rejoin(row)

    def _rejoin(self, row: int) -> None:
        """Go on along SUMO's line from where a script ended."""
        of = self._of
        course = of["course"][row] = of["raw_heading"][row]
        of["travel"][row], of["noted"][row] = course, np.nan
        away = of["front"][row] - of["raw"][row]
        of["jump"][row] = away[1] * np.cos(course) - away[0] * np.sin(course) - of["lane_offset"][row]
        of["jump_at"][row], of["jump_steep"][row] = 0.0, 0.0
        of["jump_length"][row] = float(drift.change_length(np.zeros(1))[0])

    def _enter(self, actors: Actors, rows: np.ndarray) -> None:
        """Take new road users as SUMO has them."""
        of = self._of
        for row in rows:
            for name in _STATE:
                of[name][row] = 0.0
            self._trails.pop(actors.ids[row], None)
            self._footsteps.pop(actors.ids[row], None)
            of["lane_offset"][row] = self._lane_offsets.get(actors.ids[row], 0.0)
        course = actors.heading_rad[rows]
        left = np.column_stack([-np.sin(course), np.cos(course)])
        of["raw"][rows] = actors.front[rows, :2]
        of["front"][rows] = actors.front[rows, :2] + of["lane_offset"][rows, None] * left
        for name in ("heading", "course", "travel", "raw_heading"):
            of[name][rows] = course
        of["speed"][rows] = actors.speed_mps[rows]
        of["jump_length"][rows] = 1.0
        of["noted"][rows] = np.nan
        of["known"][rows] = 1.0

    def _report(self, actors: Actors, before: np.ndarray, heading_before: np.ndarray, fresh: np.ndarray) -> Actors:
        of, step = self._of, self._step_s
        half = np.where(self._walks, 0.0, actors.size[:, 0] / 2)
        along, across, turning = velocities((before, heading_before), (of["front"], of["heading"]), half, step)
        along = np.where(fresh, actors.speed_mps, along)
        across, turning = (np.where(fresh, 0.0, rate) for rate in (across, turning))
        acceleration = np.where(fresh, actors.acceleration_mps2, (along - of["along"]) / step)
        of["along"] = along.copy()
        pulls = np.column_stack([acceleration, along * turning])
        pulls[self._walks | actors.parked] = 0.0
        springs = self._springs.step(of["springs"].reshape(-1, 2, 2), pulls)
        of["springs"] = springs.reshape(-1, 4)
        return replace(
            actors,
            front=np.column_stack([of["front"], actors.front[:, 2]]),
            heading_rad=of["heading"].copy(),
            speed_mps=along,
            lateral_mps=across,
            acceleration_mps2=acceleration,
            yaw_rate_radps=turning,
            body_pitch_rad=springs[:, 0, 0],
            body_roll_rad=springs[:, 1, 0],
        )

    def _remap(self, actors: Actors) -> None:
        """Keep the state of those who stay; zeros (not `known`) for those who enter."""
        source = np.array([self._rows.get(name, -1) for name in actors.ids], int)
        for name, values in self._of.items():
            kept = np.zeros((len(actors), *values.shape[1:]))
            stays = source >= 0
            kept[stays] = values[source[stays]]
            self._of[name] = kept
        self._ids = actors.ids
        self._rows = {name: row for row, name in enumerate(actors.ids)}
        self._chassis = Chassis.of(actors.kinds, actors.size[:, 0])
        self._walks = np.array([kind == "pedestrian" for kind in actors.kinds], bool)


def _bumpers(actors: Actors, heading_rad: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """From the middles of boxes to their front ends (k, 2)."""
    forward = unit_vectors(heading_rad[rows])
    return actors.size[rows, :1] / 2 * forward


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.hypot(vectors[:, 0], vectors[:, 1])
