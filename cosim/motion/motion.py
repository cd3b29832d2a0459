"""Between SUMO and the bridge: road users that move as bodies do."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim.actors import Actors
from cosim.motion import drift
from cosim.motion.bicycle import BicycleState, follow
from cosim.motion.body import Springs
from cosim.motion.chassis import Chassis
from cosim.motion.script import Script
from cosim.motion.trail import Trail
from cosim.motion.walking import walk

_ARRIVED_M = 0.5  # SUMO puts vehicles that begin parked on the lane first
_COURSE_GAIN = 0.3
_TRAVELS_M = 0.02
_STATE = {"front": 2, "raw": 2, "velocity": 2, "springs": 4}
_STATE |= dict.fromkeys(("heading", "curvature", "speed", "course", "travel", "raw_heading"), 1)
_STATE |= dict.fromkeys(("jump", "jump_at", "jump_length", "jump_steep", "lane_offset", "along", "way", "known"), 1)


@dataclass(frozen=True)
class Approach:
    """A way to a parking place at the kerb.

    Attributes:
        stop: (2,) where SUMO's front bumper will stand, on the lane, when it jumps to the place.
        offset_m: lateral position of the place, positive to the left.
        start_m, end_m: distances before `stop` between which the vehicle moves over.
    """

    stop: np.ndarray
    offset_m: float
    start_m: float
    end_m: float


class Motion:
    """Smooths all road users step by step; all steps of an episode, warm-up included, must pass through it.

    Vehicles are rear-axle bicycles whose front bumpers follow SUMO's; where SUMO's position jumps sideways they move
    over gradually; scripts override both. People on foot follow with limited acceleration. Who is parked stands still.

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
        self._scripts: dict[str, tuple[Script, int]] = {}
        self._approaches: dict[str, Approach] = {}
        self._exits: dict[str, float] = {}
        self._trails: dict[str, Trail] = {}

    def keep_offset(self, vehicle: str, offset_m: float) -> None:
        """Let a vehicle drive beside the middle of its lane, positive to the left."""
        self._lane_offsets[vehicle] = offset_m
        if vehicle in self._rows:
            self._of["lane_offset"][self._rows[vehicle]] = offset_m

    def play(self, vehicle: str, script: Script) -> None:
        """Let a vehicle move by a script from the next step on, whatever SUMO does with it."""
        self._scripts[vehicle] = (script, 0)

    def plays(self, vehicle: str) -> bool:
        """Whether a script still runs."""
        return vehicle in self._scripts

    def lag(self) -> np.ndarray:
        """How far the wheeled and unparked are from SUMO's places beyond their sideways ways (n,) [m]."""
        of = self._of
        meant = np.abs(of["jump"]) + 4.0 * np.array([name in self._approaches for name in self._ids], float)
        return np.where(self._walks, 0.0, np.maximum(_length(of["raw"] - of["front"]) - meant, 0.0))

    def ahead(self) -> np.ndarray:
        """How far SUMO's places are before the bumpers, in the direction these point (n,) [m]."""
        away, heading = self._of["raw"] - self._of["front"], self._of["heading"]
        return away[:, 0] * np.cos(heading) + away[:, 1] * np.sin(heading)

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
        fresh |= actors.parked & (of["way"] < _ARRIVED_M) & (_length(raw - of["raw"]) > drift.JUMP_M)
        self._enter(actors, np.flatnonzero(fresh))
        before, heading_before = of["front"].copy(), of["heading"].copy()

        of["jump"][actors.parked] = 0.0
        drives = np.flatnonzero(~self._walks & ~actors.parked)
        if drives.size:
            self._drive(actors, drives)
        walks = np.flatnonzero(self._walks)
        if walks.size:
            of["front"][walks], of["velocity"][walks], of["heading"][walks] = walk(
                before[walks], of["velocity"][walks], heading_before[walks], raw[walks], raw_heading[walks], step
            )
        of["raw"], of["raw_heading"] = raw.copy(), raw_heading.copy()
        self._run_scripts()
        return self._report(actors, before, heading_before, fresh)

    def _drive(self, actors: Actors, rows: np.ndarray) -> None:
        of = self._of
        raw, raw_heading = actors.front[rows, :2], actors.heading_rad[rows]
        moved = raw - of["raw"][rows]
        distance = actors.speed_mps[rows] * self._step_s
        chord = of["raw_heading"][rows] + _wrap(raw_heading - of["raw_heading"][rows]) / 2
        jump = drift.lateral_jump(moved, chord, distance)
        jumped = np.flatnonzero(jump)
        for i in jumped:
            self._take_up_jump(actors, int(rows[i]), float(jump[i]))
        along = np.where(jump != 0, 0.0, _length(moved))
        of["way"][rows] += distance
        of["jump_at"][rows] += np.where(jump != 0, distance, along)

        travels = (along > _TRAVELS_M) & (jump == 0)
        travel = np.where(travels, np.arctan2(moved[:, 1], moved[:, 0]), of["travel"][rows])
        travel = np.where(jump != 0, raw_heading, travel)
        of["travel"][rows] = travel
        gain = np.where(travels, _COURSE_GAIN, 0.0)
        course = _wrap(of["course"][rows] + gain * _wrap(raw_heading - of["course"][rows]))
        of["course"][rows] = course

        offset, slope = self._offset(rows)
        left = np.column_stack([-np.sin(course), np.cos(course)])
        target = raw + offset[:, None] * left
        state = BicycleState(of["front"][rows], of["heading"][rows], of["curvature"][rows], of["speed"][rows])
        chassis = self._chassis.take(rows)
        travel = travel + np.arctan(slope)
        for i in np.flatnonzero(chassis.guide_m > 0):
            guide = float(chassis.guide_m[i])
            target[i], travel[i] = self._trail(actors.ids[rows[i]], target[i], float(raw_heading[i])).behind(guide)
        state = follow(state, chassis, target, raw_heading, travel, self._step_s)
        of["front"][rows], of["heading"][rows] = state.front, state.heading_rad
        of["curvature"][rows], of["speed"][rows] = state.curvature_per_m, state.speed_mps

    def _trail(self, vehicle: str, target: np.ndarray, heading_rad: float) -> Trail:
        trail = self._trails.get(vehicle)
        if trail is None:
            trail = self._trails[vehicle] = Trail(target, heading_rad)
        trail.add(target)
        return trail

    def _offset(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lateral offsets (m,) from SUMO's line and their change per metre of way."""
        of = self._of

        def left_over(at: np.ndarray) -> np.ndarray:
            share = at / np.maximum(of["jump_length"][rows], 1e-6)
            return of["jump"][rows] * np.where(of["jump_steep"][rows] > 0, drift.steep(share), drift.smooth(share))

        at = of["jump_at"][rows]
        offset, slope = left_over(at), (left_over(at + 0.1) - left_over(at - 0.1)) / 0.2
        for vehicle, approach in self._approaches.items():
            row = self._rows.get(vehicle)
            hit = np.flatnonzero(rows == row) if row is not None else ()
            for i in hit:
                left_m = float(np.linalg.norm(self._of["raw"][row] - approach.stop))
                share = (approach.start_m - left_m) / (approach.start_m - approach.end_m)
                ahead = share + 0.1 / (approach.start_m - approach.end_m)
                offset[i] += approach.offset_m * (1 - float(drift.smooth(np.array(share))))
                change = float(drift.smooth(np.array(share)) - drift.smooth(np.array(ahead)))
                slope[i] += approach.offset_m * change / 0.1
        return offset + of["lane_offset"][rows], slope

    def _take_up_jump(self, actors: Actors, row: int, jump_m: float) -> None:
        """Keep the place on the road: what SUMO jumps, the offset takes back."""
        of, vehicle = self._of, actors.ids[row]
        if vehicle in self._scripts:
            return
        offset, _ = self._offset(np.array([row]))
        of["jump"][row] = offset[0] - of["lane_offset"][row] - jump_m
        if vehicle in self._approaches:
            del self._approaches[vehicle]
        steep = self._exits.pop(vehicle, None)
        of["jump_at"][row] = 0.0
        of["jump_steep"][row] = 0.0 if steep is None else 1.0
        of["jump_length"][row] = float(drift.change_length(actors.speed_mps[[row]])[0]) if steep is None else steep

    def _run_scripts(self) -> None:
        of = self._of
        for vehicle, (script, at) in list(self._scripts.items()):
            row = self._rows.get(vehicle)
            if row is None or at >= len(script):
                del self._scripts[vehicle]
                if row is not None:
                    self._rejoin(row)
                continue
            of["front"][row], of["heading"][row] = script.front[at], script.heading_rad[at]
            of["curvature"][row] = of["speed"][row] = 0.0
            self._scripts[vehicle] = (script, at + 1)

    def _rejoin(self, row: int) -> None:
        """Go on along SUMO's line from where a script ended."""
        of = self._of
        course = of["course"][row] = of["raw_heading"][row]
        of["travel"][row] = course
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
            of["lane_offset"][row] = self._lane_offsets.get(actors.ids[row], 0.0)
        course = actors.heading_rad[rows]
        left = np.column_stack([-np.sin(course), np.cos(course)])
        of["raw"][rows] = actors.front[rows, :2]
        of["front"][rows] = actors.front[rows, :2] + of["lane_offset"][rows, None] * left
        for name in ("heading", "course", "travel", "raw_heading"):
            of[name][rows] = course
        of["speed"][rows] = actors.speed_mps[rows]
        of["jump_length"][rows] = 1.0
        of["known"][rows] = 1.0

    def _report(self, actors: Actors, before: np.ndarray, heading_before: np.ndarray, fresh: np.ndarray) -> Actors:
        of, step = self._of, self._step_s
        heading = of["heading"]
        half = np.where(self._walks, 0.0, actors.size[:, 0] / 2)[:, None]
        forward = np.column_stack([np.cos(heading), np.sin(heading)])
        was = np.column_stack([np.cos(heading_before), np.sin(heading_before)])
        velocity = (of["front"] - before - half * (forward - was)) / step
        velocity[fresh] = actors.speed_mps[fresh, None] * forward[fresh]
        along = velocity[:, 0] * forward[:, 0] + velocity[:, 1] * forward[:, 1]
        across = velocity[:, 1] * forward[:, 0] - velocity[:, 0] * forward[:, 1]
        turning = np.where(fresh, 0.0, _wrap(heading - heading_before) / step)
        acceleration = np.where(fresh, actors.acceleration_mps2, (along - of["along"]) / step)
        of["along"] = along.copy()
        still = self._walks | actors.parked
        pulls = np.column_stack([acceleration, along * turning])
        pulls[still] = 0.0
        springs = self._springs.step(of["springs"].reshape(-1, 2, 2), pulls)
        of["springs"] = springs.reshape(-1, 4)
        return replace(
            actors,
            front=np.column_stack([of["front"], actors.front[:, 2]]),
            heading_rad=heading.copy(),
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


def _wrap(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.hypot(vectors[:, 0], vectors[:, 1])
