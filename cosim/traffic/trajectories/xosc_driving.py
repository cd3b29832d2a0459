"""Motion of a vehicle that follows its lane, with speeds and lane changes that start at known times.

ASAM OpenSCENARIO XML 1.3, 7.4.1 and class TransitionDynamics: without another controller an entity keeps its speed and
its lane. The motion is evaluated in steps along the reference lines of the road network.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cosim.traffic.opendrive import OpenDriveError, RoadLocation, RoadNetwork
from cosim.traffic.trajectories.xosc_entities import Limits
from cosim.traffic.trajectories.xosc_locations import shifted_lane

STEP_S = 0.1
_SUBSTEPS = 4
_PEAK = {"linear": 1.0, "cubic": 1.5, "sinusoidal": math.pi / 2}  # highest rate over mean rate
_BEND = {"linear": 0.0, "cubic": 6.0, "sinusoidal": math.pi**2 / 2}  # highest second derivative over change, duration 1
_LEAST_RATE = 1e-6


@dataclass(frozen=True)
class Transition:
    """Change of a speed or of a lateral position.

    Attributes:
        shape: `linear`, `cubic`, `sinusoidal` or `step`.
        dimension: of `value`: `time` [s], `distance` [m], `rate` [per s] or `acceleration` [per s²].
        value: duration, distance travelled, highest rate of change, or highest second derivative.
    """

    shape: str
    dimension: str
    value: float

    def fraction(self, done: float) -> float:
        """Share of the change that is made when a share of its duration is over."""
        done = min(max(done, 0.0), 1.0)
        if self.shape == "linear":
            return done
        if self.shape == "cubic":
            return done * done * (3 - 2 * done)
        return (1 - math.cos(math.pi * done)) / 2

    def duration_s(self, change: float) -> float:
        """Duration of a change, if it does not depend on the distance travelled."""
        if self.shape == "step":
            return 0.0
        if self.dimension == "rate":
            return _PEAK[self.shape] * abs(change) / max(abs(self.value), _LEAST_RATE)
        if self.dimension == "acceleration":
            return math.sqrt(_BEND[self.shape] * abs(change) / max(abs(self.value), _LEAST_RATE))
        return self.value


@dataclass(frozen=True)
class SpeedChange:
    """Speed action: it starts at a time [s] and ends with a target speed [m/s]."""

    start_s: float
    target_mps: float
    transition: Transition

    def duration_s(self, from_mps: float, limits: Limits) -> float:
        """Duration of the change, as short as the vehicle's performance allows [s]."""
        change_mps = self.target_mps - from_mps
        if self.transition.shape == "step" or change_mps == 0:
            return 0.0
        if self.transition.dimension == "distance":
            mean_mps = (from_mps + self.target_mps) / 2
            duration_s = self.transition.value / mean_mps if mean_mps > 0 else 0.0
        else:
            duration_s = self.transition.duration_s(change_mps)
        if duration_s == 0:
            return 0.0
        limit_mps2 = limits.acceleration_mps2 if change_mps > 0 else limits.deceleration_mps2
        return max(duration_s, _PEAK[self.transition.shape] * abs(change_mps) / limit_mps2)


class SpeedProfile:
    """Speed over time.

    Args:
        changes: in the order of their starts; a change replaces the one before.
        limits: performance of the vehicle.
    """

    def __init__(self, changes: Sequence[SpeedChange], limits: Limits) -> None:
        self._pieces: list[tuple[float, float, float, float, Transition]] = []  # start, from, to, duration, transition
        for change in changes:
            target_mps = math.copysign(min(abs(change.target_mps), limits.speed_mps), change.target_mps)
            change = replace(change, target_mps=target_mps)
            before_mps = self.at(change.start_s)
            duration_s = change.duration_s(before_mps, limits)
            self._pieces.append((change.start_s, before_mps, target_mps, duration_s, change.transition))

    def at(self, time_s: float) -> float:
        """Speed at a time [m/s]; 0 before the first change."""
        for start_s, before_mps, target_mps, duration_s, transition in reversed(self._pieces):
            if start_s <= time_s + 1e-9:
                done = (time_s - start_s) / duration_s if duration_s > 0 else 1.0
                return before_mps + transition.fraction(done) * (target_mps - before_mps)
        return 0.0

    def is_constant_after(self, time_s: float) -> bool:
        """Whether no change starts or is under way after a time."""
        return all(piece[0] + piece[3] <= time_s + 1e-9 for piece in self._pieces)


@dataclass(frozen=True)
class LaneChange:
    """Lane change or change of the offset in the lane.

    Attributes:
        start_s: [s].
        lane: id of the target lane; None if it follows from the next two.
        by: number of lanes to the left of the own lane, or of the lane of another vehicle, as seen in that vehicle's
            direction of travel; None keeps the lane.
        other: location of another vehicle at a time; None for changes relative to the own lane.
        offset_m: offset from the middle of the target lane at the end.
        transition: of the lateral position.
    """

    start_s: float
    lane: int | None
    by: int | None
    other: Callable[[float], RoadLocation] | None
    offset_m: float
    transition: Transition


@dataclass
class _Lateral:
    """Distance from the target line that is left at the start of a change, and how much of the change is over."""

    transition: Transition | None = None
    start_m: float = 0.0
    over: float = 1.0

    def left_m(self) -> float:
        return 0.0 if self.transition is None else self.start_m * (1 - self.transition.fraction(self.over))


@dataclass(frozen=True, eq=False)
class Driven:
    """Motion of a vehicle.

    Attributes:
        rows: (n, 5) time [s], x, y, z [m], heading [rad].
        ends_at: why the motion ends before the requested time; empty if it does not.
    """

    rows: np.ndarray
    ends_at: str = ""


@dataclass
class LaneDriver:
    """A vehicle on its lane.

    Attributes:
        network: roads.
        location: where it is.
        speed: over time.
        lanes: changes in the order of their starts.
    """

    network: RoadNetwork
    location: RoadLocation
    speed: SpeedProfile
    lanes: Sequence[LaneChange]
    _speed_mps: float = 0.0
    _lateral: _Lateral = field(default_factory=_Lateral)

    def drive(self, end_s: float) -> Driven:
        """Motion from 0 to a time [s].

        Raises:
            OpenDriveError: the road has no such lane as a lane change aims at.
        """
        lanes, step_s = list(self.lanes), STEP_S / _SUBSTEPS
        rows: list[list[float]] = []
        for number in range(math.ceil(end_s / step_s - 1e-9) + 1):
            time_s = number * step_s
            self._speed_mps = self.speed.at(time_s)
            while lanes and lanes[0].start_s <= time_s + 1e-9:
                self._begin_lane(lanes.pop(0))
            lateral_mps = self._lateral_rate_mps(step_s)
            if number % _SUBSTEPS == 0:
                rows.append(self._row(time_s, lateral_mps))
            mean_mps = (self._speed_mps + self.speed.at(time_s + step_s)) / 2
            along_mps = math.copysign(math.sqrt(max(mean_mps**2 - lateral_mps**2, 0.0)), mean_mps)
            left_m = self._move(along_mps * step_s, step_s)
            if left_m > 0:
                return Driven(np.array(rows), self._reason(time_s))
        return Driven(np.array(rows))

    def _begin_lane(self, change: LaneChange) -> None:
        now_m = self.network.lateral_m(self.location) + self._lateral.left_m()
        lane = self.location.lane if change.lane is None else change.lane
        if change.by is not None:
            reference = self._reference(change)
            lane = shifted_lane(reference.lane, change.by * reference.travel)
        self.location = replace(self.location, lane=lane, offset_m=change.offset_m)
        start_m = now_m - self.network.lateral_m(self.location)
        is_step = change.transition.shape == "step"
        self._lateral = _Lateral() if is_step else _Lateral(change.transition, start_m, 0.0)

    def _reference(self, change: LaneChange) -> RoadLocation:
        if change.other is None:
            return self.location
        other = change.other(change.start_s)
        if other.road != self.location.road:
            raise OpenDriveError(
                f"the lane change at {change.start_s:g} s is relative to a vehicle on road {other.road!r}, not on "
                f"{self.location.road!r}"
            )
        return other

    def _lateral_share(self, step_s: float) -> float:
        """Share of the present lateral change that a step takes."""
        transition = self._lateral.transition
        if transition is None:
            return 1.0
        if transition.dimension == "distance":
            return self._speed_mps * step_s / transition.value if transition.value > 0 else 1.0
        duration_s = transition.duration_s(self._lateral.start_m)
        return step_s / duration_s if duration_s > 0 else 1.0

    def _lateral_rate_mps(self, step_s: float) -> float:
        """Rate of change of the lateral position by the present lane change."""
        lateral = self._lateral
        if lateral.transition is None or lateral.over >= 1:
            return 0.0
        share = self._lateral_share(step_s)
        before, after = (lateral.transition.fraction(lateral.over + part * share) for part in (-0.5, 0.5))
        return -lateral.start_m * (after - before) / step_s

    def _move(self, way_m: float, step_s: float) -> float:
        """Move by a step; the distance that the road is too short for."""
        self._lateral.over += self._lateral_share(step_s)
        if self._lateral.over >= 1:
            self._lateral = _Lateral()
        if way_m == 0:
            return 0.0
        was = self.location.travel
        scale = self._length_of_lane(way_m)
        self.location, left_m = self.network.advance(
            self.location if way_m > 0 else replace(self.location, travel=-was), abs(way_m) / scale
        )
        if way_m < 0:
            self.location = replace(self.location, travel=-self.location.travel)
        if self.location.travel != was:
            self._lateral.start_m = -self._lateral.start_m
        return left_m

    def _length_of_lane(self, way_m: float) -> float:
        """Length of the vehicle's way over that of the reference line, which differ in bends."""
        ahead_m = math.copysign(min(max(abs(way_m), 0.05), 0.5), way_m) * self.location.travel
        road = self.network.road(self.location.road)
        s_m = min(max(self.location.s_m, 0.0), road.length_m)
        s_near = min(max(s_m + ahead_m, 0.0), road.length_m)
        if abs(s_near - s_m) < 0.01:
            s_m = min(max(s_m - ahead_m, 0.0), road.length_m)
        t_m = self.network.lateral_m(self.location) + self._lateral.left_m()
        one, other = (np.array(road.pose(s, t_m)[:3]) for s in (s_m, s_near))
        scale = float(np.linalg.norm(other - one)) / max(abs(s_near - s_m), 1e-9)
        return min(max(scale, 0.2), 5.0)

    def _row(self, time_s: float, lateral_rate_mps: float) -> list[float]:
        location = replace(self.location, offset_m=self.location.offset_m + self._lateral.left_m())
        x, y, z, heading = self.network.pose(location)
        speed_mps = abs(self._speed_mps)
        if speed_mps > 0.1:  # the speed is that of the whole motion, also sideways
            drift = math.asin(min(max(lateral_rate_mps / speed_mps, -1.0), 1.0))
            heading += drift * location.travel * math.copysign(1.0, self._speed_mps)
        return [time_s, x, y, z, heading]

    def _reason(self, time_s: float) -> str:
        """Why the vehicle cannot go on at its present location."""
        try:
            ways = len(self.network.onward(self.location))
        except OpenDriveError:
            ways = 0
        where = f"road {self.location.road!r} at {time_s:.1f} s"
        return f"{where}, which goes on in {ways} ways without a route" if ways > 1 else f"the end of {where}"
