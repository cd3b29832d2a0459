"""Motion of the entities of an OpenSCENARIO file: standing, driving on a lane, or on a trajectory."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cosim.traffic.opendrive import OpenDriveError, RoadLocation, clothoid
from cosim.traffic.trajectories.tracks import TrackSample, TrajectoryError
from cosim.traffic.trajectories.xosc_driving import (
    STEP_S,
    LaneChange,
    LaneDriver,
    SpeedChange,
    SpeedProfile,
    Transition,
)
from cosim.traffic.trajectories.xosc_entities import Limits
from cosim.traffic.trajectories.xosc_locations import Location, Locations

REMEDY = "run the scenario in a simulator, for example esmini, and give its table of trajectories"
_STARTS_S = 0.05  # a trajectory that starts so soon starts immediately
_DRIVES_S, _LONGEST_S = 30.0, 600.0  # duration without a stop time, and longest one
_STANDS_MPS = 1e-3
_ACROSS = 0.35  # sine of the angle to the lane above which an entity does not follow it
_CLOTHOID_M = 0.5  # distance of the points of a clothoid


@dataclass(frozen=True)
class SpeedAction:
    """Speed action.

    Attributes:
        start_s: [s].
        target: speed [m/s], or, with `reference`, what is added to that entity's speed [m/s] or its factor.
        transition: of the speed.
        reference: entity; empty for absolute speeds.
        is_factor: see `target`.
        is_continuous: the target follows the entity's speed.
    """

    start_s: float
    target: float
    transition: Transition
    reference: str = ""
    is_factor: bool = False
    is_continuous: bool = False


@dataclass(frozen=True)
class LaneAction:
    """Lane change, or change of the offset in the lane.

    Attributes:
        start_s: [s].
        lane: target lane, or, with `reference`, the number of lanes to the left of that entity's; None keeps the lane.
        reference: entity; empty for absolute lanes.
        offset_m: offset in the target lane at the end.
        transition: of the lateral position.
    """

    start_s: float
    lane: int | None
    reference: str
    offset_m: float
    transition: Transition


@dataclass(frozen=True)
class TrajectoryAction:
    """Action of the library that follows a trajectory.

    Attributes:
        action: of the library.
        start_s: [s]; None if it starts when a traffic condition is met.
        unknown: names of these conditions.
    """

    action: Any
    start_s: float | None
    unknown: tuple[str, ...]


@dataclass
class Way:
    """Motion of one entity, as its actions define it.

    Attributes:
        speeds, lanes, trajectories: actions.
        controller: name of a controller, or of an action, to which the motion is left; empty without one.
    """

    speeds: list[SpeedAction] = field(default_factory=list)
    lanes: list[LaneAction] = field(default_factory=list)
    trajectories: list[TrajectoryAction] = field(default_factory=list)
    controller: str = ""

    def drives(self) -> bool:
        """Whether the entity moves by its speed."""
        return any(abs(change.target) > _STANDS_MPS or change.reference for change in self.speeds)


class ScenarioMotion:
    """Evaluates the motion of all entities.

    Args:
        path: for messages.
        locations: evaluates positions.
        ways: motion of each entity.
        limits: performance of each.
        xosc: the library.

    Raises:
        TrajectoryError: the motion of an entity is left to a controller.
    """

    def __init__(
        self, path: Path, locations: Locations, ways: Mapping[str, Way], limits: Mapping[str, Limits], xosc: Any
    ) -> None:
        self._path, self._locations, self._ways, self._limits, self._xosc = path, locations, ways, limits, xosc
        self._profiles: dict[str, SpeedProfile | None] = {}
        self._rows: dict[int, np.ndarray] = {}
        self.notes: list[str] = []
        for name, way in ways.items():
            if way.controller and not way.trajectories:
                raise TrajectoryError(
                    f"{path}: the motion of {name!r} is left to a controller ({way.controller}), which is not part of "
                    f"the file: {REMEDY}"
                )

    def end_s(self, stop_s: float | None) -> float:
        """End of the scenario [s]: its stop time, else that of all motions that the file defines.

        Args:
            stop_s: stop time; 0 or None if the file has none.
        """
        if stop_s:
            return min(stop_s, _LONGEST_S)
        ways = self._ways.values()
        ends = [self._trajectory(name, each)[-1, 0] for name, way in self._ways.items() for each in way.trajectories]
        if not any(way.drives() for way in ways):
            return max(ends, default=1.0)
        starts = [change.start_s for way in ways for change in (*way.speeds, *way.lanes)]
        end_s = min(max(max(starts) + _DRIVES_S, *ends, 0.0), _LONGEST_S)
        self.notes.append(f"the scenario has no stop time: vehicles drive for {end_s:g} s")
        return end_s

    def samples(self, name: str, end_s: float) -> list[TrackSample]:
        """An entity's track at 10 Hz: on its lane, or at its initial position, until its trajectory starts."""
        way, start = self._ways[name], self._locations.start_of(name)
        trajectories = sorted((self._trajectory(name, each) for each in way.trajectories), key=lambda rows: rows[0, 0])
        if start is None and not trajectories:
            raise TrajectoryError(
                f"{self._path}: nothing says where {name!r} is; give a TeleportAction in Init or a trajectory"
            )
        parts = [_dense(rows) for rows in trajectories]
        first_s = parts[0][0, 0] if parts else math.inf
        if any(change.start_s >= first_s for change in way.lanes):
            raise TrajectoryError(
                f"{self._path}: {name!r} changes lane after its trajectory has started, so its way is up to the "
                f"simulator: {REMEDY}"
            )
        if start is not None and first_s > _STARTS_S:
            until_s = min(first_s - STEP_S / 2, max(end_s, 1.0))
            is_driven = way.drives() or bool(way.lanes)
            parts.insert(0, self._driven(name, start, until_s) if is_driven else _standing(start, until_s))
        return [
            TrackSample(time_s=time_s, user=name, x_m=x, y_m=y, z_m=z, heading_rad=heading)
            for time_s, x, y, z, heading in np.concatenate(parts).tolist()
        ]

    def _speed(self, name: str) -> SpeedProfile:
        """Speed of an entity over time.

        Raises:
            TrajectoryError: a speed relative to another entity depends on what is known only in simulation.
        """
        if name not in self._profiles:
            self._profiles[name] = None  # under evaluation
            actions = sorted(self._ways[name].speeds, key=lambda action: action.start_s)
            changes = [
                SpeedChange(action.start_s, self._target_mps(name, action), action.transition) for action in actions
            ]
            self._profiles[name] = SpeedProfile(changes, self._limits[name])
        profile = self._profiles[name]
        if profile is None:
            raise TrajectoryError(f"{self._path}: the speed of {name!r} is relative to one that is relative to it")
        return profile

    def _target_mps(self, name: str, action: SpeedAction) -> float:
        if not action.reference:
            return action.target
        other = self._ways.get(action.reference)
        reference = None if other is None or other.trajectories else self._speed(action.reference)
        is_known = reference is not None and not (
            action.is_continuous and not reference.is_constant_after(action.start_s)
        )
        if reference is None or not is_known:
            raise TrajectoryError(
                f"{self._path}: the speed of {name!r} is relative to that of {action.reference!r}, which is known only "
                f"in simulation: {REMEDY}"
            )
        speed_mps = reference.at(action.start_s)
        return speed_mps * action.target if action.is_factor else speed_mps + action.target

    def _lane_changes(self, name: str, until_s: float) -> list[LaneChange]:
        actions = sorted(self._ways[name].lanes, key=lambda action: action.start_s)
        changes = []
        for action in (action for action in actions if action.start_s <= until_s):
            is_own = action.reference == name
            lane, by = action.lane, action.lane if is_own else None
            if lane is not None and action.reference and not is_own:
                lane, by = None, lane
            lane_of = None if is_own or not action.reference else partial(self._location_at, name, action.reference)
            changes.append(
                LaneChange(action.start_s, None if is_own else lane, by, lane_of, action.offset_m, action.transition)
            )
        return changes

    def _location_at(self, name: str, other: str, time_s: float) -> RoadLocation:
        """Where another entity is on the roads at a time.

        Raises:
            TrajectoryError: it does not drive on a lane then.
        """
        way, start = self._ways.get(other), self._locations.start_of(other)
        if (
            way is None
            or start is None
            or way.trajectories
            or any(each.reference not in ("", other) for each in way.lanes)
        ):
            raise TrajectoryError(
                f"{self._path}: {name!r} changes to a lane relative to {other!r}, which is known only in simulation: "
                f"{REMEDY}"
            )
        driver = self._driver(other, start, time_s)
        driver.drive(time_s)
        return driver.location

    def _driver(self, name: str, start: Location, until_s: float) -> LaneDriver:
        road = self._locations.nearest(start)
        if road is None:
            raise TrajectoryError(
                f"{self._path}: {name!r} drives from a location beyond the ends of all roads, so its way is not defined"
            )
        along = self._locations.network.pose(road)[3]
        if abs(math.sin(start.pose[3] - along)) > _ACROSS:
            raise TrajectoryError(
                f"{self._path}: {name!r} has a speed, but faces across its lane, so its way is not defined: {REMEDY}"
            )
        return LaneDriver(self._locations.network, road, self._speed(name), self._lane_changes(name, until_s))

    def _driven(self, name: str, start: Location, until_s: float) -> np.ndarray:
        """Rows of a vehicle that follows its lane."""
        try:
            driven = self._driver(name, start, until_s).drive(until_s)
        except OpenDriveError as error:
            raise TrajectoryError(f"{self._path}: way of {name!r}: {error}") from error
        if driven.ends_at:
            self.notes.append(f"{name!r} leaves at {driven.ends_at}")
        return driven.rows

    def _trajectory(self, name: str, each: TrajectoryAction) -> np.ndarray:
        """A trajectory as rows of time, x, y, z, heading."""
        if id(each) not in self._rows:
            self._rows[id(each)] = self._evaluate(name, each)
        return self._rows[id(each)]

    def _evaluate(self, name: str, each: TrajectoryAction) -> np.ndarray:
        path, timing = self._path, each.action.timeref
        times, points = self._shape(name, each)
        scale = None if times is None else timing.scale
        is_relative = scale is None or timing.reference_domain.get_name() == "relative"
        if is_relative and each.start_s is None:
            raise TrajectoryError(
                f"{path}: the trajectory of {name!r} starts when a traffic condition is met "
                f"({', '.join(each.unknown)}), at a time that is known only in simulation: {REMEDY}"
            )
        begins_s = (each.start_s or 0.0) if is_relative else 0.0
        if times is not None and scale is not None:
            times = times * float(scale) + float(timing.offset) + begins_s
        else:
            times, points = self._at_own_speed(name, points, begins_s)
        if (np.diff(times) <= 0).any() or not np.isfinite(times).all():
            raise TrajectoryError(
                f"{path}: times of the trajectory of {name!r} do not grow; order its vertices by time"
            )
        return np.column_stack([times, points])

    def _shape(self, name: str, each: TrajectoryAction) -> tuple[np.ndarray | None, np.ndarray]:
        """Times (n,), None without any, and x, y, z, heading (n, 4) of a trajectory's vertices."""
        xosc, trajectory = self._xosc, each.action.trajectory
        shape = trajectory.shapes if isinstance(trajectory, xosc.Trajectory) else trajectory
        standing = self._standing(name, each.start_s)
        if isinstance(shape, xosc.Polyline):
            points = np.array([self._locations.location(name, one, standing).pose for one in shape.positions])
            return (np.array(shape.time, float) if shape.time else None), points
        if isinstance(shape, xosc.Clothoid):
            x, y, z, heading = self._locations.location(name, shape.startposition, standing).pose.tolist()
            along = np.linspace(0, shape.length, max(2, math.ceil(shape.length / _CLOTHOID_M) + 1))
            line = clothoid(
                x, y, 0.0 if math.isnan(heading) else heading, shape.curvature, shape.curvature_change, along
            )
            points = np.column_stack([line[:, :2], np.full(len(along), z), line[:, 2]])
            start_s, stop_s = shape.starttime, shape.stoptime
            return (None if start_s is None else start_s + (stop_s - start_s) * along / shape.length), points
        raise TrajectoryError(
            f"{self._path}: the trajectory of {name!r} is a {type(shape).__name__}; a Polyline or Clothoid can be "
            f"replayed: {REMEDY}"
        )

    def _at_own_speed(self, name: str, points: np.ndarray, begins_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Times and points of a trajectory without times, which is followed at the entity's own speed."""
        speed = self._speed(name)
        steps = begins_s + np.arange(0.0, _LONGEST_S, STEP_S)
        rates = np.array([speed.at(time_s) for time_s in steps])
        way_m = np.concatenate([[0.0], np.cumsum((rates[1:] + rates[:-1]) / 2 * STEP_S)])
        along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1))])
        if len(points) < 2 or (rates < 0).any() or rates.max() <= _STANDS_MPS or along_m[-1] <= 0:
            raise TrajectoryError(
                f"{self._path}: the trajectory of {name!r} has no times, and the entity has no speed at which to "
                "follow it; give its vertices times, or the entity a SpeedAction in Init"
            )
        moving = np.concatenate([[True], np.diff(way_m) > 1e-9])
        kept = np.concatenate([[True], np.diff(along_m) > 1e-6])
        reached = along_m[kept] <= way_m[-1]
        return np.interp(along_m[kept][reached], way_m[moving], steps[moving]), points[kept][reached]

    def _standing(self, name: str, start_s: float | None) -> Collection[str]:
        """Entities that are still at their initial position when a trajectory of `name` starts."""
        if start_s is not None and start_s <= 0:
            return set(self._ways) | self._locations.named
        still = {other for other, way in self._ways.items() if not (way.drives() or way.trajectories)}
        still |= self._locations.named - set(self._ways)
        own = self._ways[name]
        return still | {name} if not own.drives() and len(own.trajectories) == 1 else still


def _standing(start: Location, until_s: float) -> np.ndarray:
    times = np.append(np.arange(0.0, until_s, STEP_S), until_s)
    return np.column_stack([times, np.tile(start.pose, (len(times), 1))])


def _dense(rows: np.ndarray) -> np.ndarray:
    """Rows of a polyline with others between its vertices, which are kept."""
    steps = np.arange(rows[0, 0], rows[-1, 0], STEP_S)
    far = np.abs(steps[:, None] - rows[None, :, 0]).min(1) > STEP_S / 4
    times = np.sort(np.concatenate([steps[far], rows[:, 0]]))
    heading = np.unwrap(rows[:, 4]) if np.isfinite(rows[:, 4]).all() else rows[:, 4]
    columns = [*rows[:, 1:4].T, heading]
    return np.column_stack([times, *(np.interp(times, rows[:, 0], column) for column in columns)])
