"""World poses of OpenSCENARIO's positions: world, lane and road coordinates, and relative to other entities.

ASAM OpenSCENARIO XML 1.3, 6.3 (coordinate systems) and the classes of `Position`. Offsets and lane ids follow the
road's own axes. Relative orientations count from the direction of the lane's traffic for lane coordinates, and from the
direction of s for road coordinates and for distances along s.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cosim.traffic.opendrive import OpenDriveError, RoadLocation, RoadNetwork, read_road_network
from cosim.traffic.trajectories.tracks import TrajectoryError


@dataclass(frozen=True, eq=False)
class Location:
    """Pose of an entity's origin.

    Attributes:
        pose: (4,) x, y, z [m] and heading [rad]; the last two NaN where the file does not give them.
        road: the same in road coordinates; None for positions that are not given in them.
    """

    pose: np.ndarray
    road: RoadLocation | None


class Locations:
    """Evaluates the positions of a scenario.

    Args:
        path: the scenario, for messages and for the location of its road network.
        road_file: `LogicFile` of the scenario; empty without one.
        initial: positions that each entity is given at the start, one after the other, by name; each may refer to the
            one before.
        xosc: the library that has parsed them.
    """

    def __init__(self, path: Path, road_file: str, initial: Mapping[str, Sequence[Any]], xosc: Any) -> None:
        self._path, self._road_file, self._initial, self._xosc = path, road_file, initial, xosc
        self._being_found: dict[str, int] = {}  # initial positions under evaluation: number in their sequence

    @cached_property
    def network(self) -> RoadNetwork:
        """Road network of the scenario.

        Raises:
            TrajectoryError: the scenario names none, or it cannot be read.
        """
        if not self._road_file:
            raise TrajectoryError(f"{self._path}: names no OpenDRIVE file (LogicFile), which lane positions refer to")
        file = self._path.parent / self._road_file
        if not file.is_file():
            raise TrajectoryError(
                f"{self._path}: its road network {file} does not exist, which lane positions refer to; put the "
                "OpenDRIVE file there, or correct LogicFile"
            )
        if file.suffix.lower() != ".xodr":
            raise TrajectoryError(f"{self._path}: its road network {file.name} is no OpenDRIVE file (.xodr)")
        return read_road_network(file)

    @property
    def named(self) -> set[str]:
        """Entities with an initial position."""
        return set(self._initial)

    def start_of(self, name: str) -> Location | None:
        """Where an entity is at the start; None if its first action does not give it."""
        return self._at_start(name, name) if self._initial.get(name) else None

    def location(self, name: str, position: Any, standing: Collection[str]) -> Location:
        """Location of an entity.

        Args:
            name: of the entity, for messages.
            position: of the library.
            standing: names of entities that are still at their initial position; others cannot be referred to.

        Raises:
            TrajectoryError: the position is of a kind that is not evaluated, or refers to what does not exist.
        """
        try:
            return self._evaluate(name, position, standing)
        except OpenDriveError as error:
            raise TrajectoryError(f"{self._path}: position of {name!r}: {error}") from error

    def _evaluate(self, name: str, position: Any, standing: Collection[str]) -> Location:
        xosc = self._xosc
        if isinstance(position, xosc.WorldPosition):
            values = [
                math.nan if value is None else value for value in (position.x, position.y, position.z, position.h)
            ]
            return Location(np.array(values, float), None)
        if isinstance(position, xosc.LanePosition):
            road = self.network.location(
                str(position.road_id), int(position.lane_id), float(position.s), float(position.offset or 0.0)
            )
            return self._on_road_facing(road, position.orient)
        if isinstance(position, xosc.RoadPosition):
            road = self.network.adjacent_location(str(position.id), float(position.s), float(position.t))
            return self._on_road_facing(replace(road, travel=1), position.orient)
        if isinstance(position, xosc.RelativeLanePosition):
            return self._relative_to_lane(name, position, standing)
        if isinstance(position, xosc.RelativeRoadPosition):
            other = self._on_road(name, position, position.target, standing)
            moved = self._moved(other, float(position.ds))
            t_m = self.network.lateral_m(other) + float(position.dt)
            road = self.network.adjacent_location(moved.road, moved.s_m, t_m)
            return self._on_road_facing(replace(road, travel=1), position.orient)
        if isinstance(position, xosc.RelativeWorldPosition | xosc.RelativeObjectPosition):
            return self._relative_to_object(name, position, standing)
        raise TrajectoryError(f"{self._path}: {name!r} has a {type(position).__name__}, which is not evaluated")

    def _on_road_facing(self, road: RoadLocation, orientation: Any) -> Location:
        """A location on a road, turned by an orientation of the library."""
        x, y, z, along = self.network.pose(road)
        relative, value = _orientation(orientation)
        heading = along + value if relative else value
        if math.cos(heading - along) < 0:
            road = replace(road, travel=-road.travel)
        return Location(np.array([x, y, z, heading]), road)

    def nearest(self, location: Location) -> RoadLocation | None:
        """The location on the road network of a location in world coordinates, in the direction of the entity."""
        if location.road is not None:
            return location.road
        found = self.network.locate(float(location.pose[0]), float(location.pose[1]))
        if found is None or not math.isfinite(location.pose[3]):
            return found
        along = self.network.pose(found)[3]
        return replace(found, travel=-found.travel) if math.cos(location.pose[3] - along) < 0 else found

    def _reference(self, name: str, position: Any, other: str, standing: Collection[str]) -> Location:
        if other not in standing or not self._initial.get(other):
            moves = "moves then" if self._initial.get(other) else "has no initial position"
            raise TrajectoryError(
                f"{self._path}: {name!r} has a {type(position).__name__} to {other!r}, which {moves}: its location is "
                "known only in simulation"
            )
        return self._at_start(name, other)

    def _at_start(self, name: str, other: str) -> Location:
        """Location of an entity at the start: the last of its initial positions, or the one before that evaluated."""
        outer = self._being_found.get(other)
        number = len(self._initial[other]) - 1 if outer is None else outer - 1
        if number < 0:
            raise TrajectoryError(f"{self._path}: positions of {name!r} and {other!r} refer to each other")
        self._being_found[other] = number
        try:
            return self.location(other, self._initial[other][number], standing=self._initial)
        finally:
            if outer is None:
                del self._being_found[other]
            else:
                self._being_found[other] = outer

    def _on_road(self, name: str, position: Any, other: str, standing: Collection[str]) -> RoadLocation:
        location = self._reference(name, position, other, standing)
        found = self.nearest(location)
        if found is None:
            raise TrajectoryError(f"{self._path}: a position of {name!r} is relative to {other!r}, which is on no road")
        return found

    def _moved(self, location: RoadLocation, ds_m: float) -> RoadLocation:
        """A location further along s, or back."""
        along = replace(location, travel=1 if ds_m >= 0 else -1)
        moved, left_m = self.network.advance(along, abs(ds_m))
        if left_m > 0:
            raise OpenDriveError(f"the road ends {left_m:.1f} m before, or goes on in several ways")
        return moved

    def _relative_to_lane(self, name: str, position: Any, standing: Collection[str]) -> Location:
        """A location in another lane, counted along s, or with `dsLane` as the reference entity travels."""
        other = self._on_road(name, position, position.entity, standing)
        along_lane = position.ds is None
        direction = other.travel if along_lane else 1
        ds_m = float((position.dsLane if along_lane else position.ds) or 0.0)
        moved = self._moved(replace(other, offset_m=0.0), direction * ds_m)
        lane = shifted_lane(moved.lane, direction * int(position.lane_id))
        road = self.network.location(moved.road, lane, moved.s_m, direction * float(position.offset or 0.0))
        return self._on_road_facing(road if along_lane else replace(road, travel=1), position.orient)

    def _relative_to_object(self, name: str, position: Any, standing: Collection[str]) -> Location:
        location = self._reference(name, position, position.target, standing)
        x, y, z, heading = location.pose.tolist()
        dx, dy, dz = (float(value or 0.0) for value in (position.dx, position.dy, position.dz))
        if isinstance(position, self._xosc.RelativeObjectPosition):
            dx, dy = dx * math.cos(heading) - dy * math.sin(heading), dx * math.sin(heading) + dy * math.cos(heading)
        relative, value = _orientation(position.orient)
        return Location(np.array([x + dx, y + dy, z + dz, heading + value if relative else value]), None)


def shifted_lane(lane: int, by: int) -> int:
    """Lane a number of lanes to the left, to the right if negative; the centre lane 0 is not counted."""
    shifted = lane + by
    crosses = lane and (shifted == 0 or (shifted > 0) != (lane > 0))
    return shifted + (1 if by > 0 else -1) if crosses and by else shifted


def _orientation(orientation: Any) -> tuple[bool, float]:
    """Whether a heading is relative, and its value [rad]; a missing orientation is a relative 0."""
    if orientation is None or (orientation.h is None and orientation.ref is None):
        return True, 0.0
    is_relative = orientation.ref is not None and orientation.ref.get_name() == "relative"
    return is_relative, float(orientation.h or 0.0)
