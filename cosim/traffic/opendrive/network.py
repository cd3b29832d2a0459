"""Roads, junctions, and ways along lanes from one road to the next."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cosim.traffic.opendrive.read import read_road
from cosim.traffic.opendrive.road import OpenDriveError, Road, RoadLink
from sumo_nets.errors import TownError
from sumo_nets.xml_guard import read_xml

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_BEYOND_M = 0.01  # s may exceed a road's length by rounding
_STEP_M, _NEAR_M, _END_M = 2.0, 0.05, 1e-5
_NEWTON_STEPS = 12
_MOST_ROADS = 10_000


@dataclass(frozen=True)
class RoadLocation:
    """Location on a road.

    Attributes:
        road: id.
        s_m: along the reference line.
        lane: id of the lane; 0 for the reference line.
        offset_m: from the middle of the lane, to the left of the reference line.
        travel: 1 along s, -1 against it: direction in which a vehicle there faces.
    """

    road: str
    s_m: float
    lane: int
    offset_m: float
    travel: int


@dataclass(frozen=True)
class JunctionPath:
    """Connection of a junction.

    Attributes:
        incoming, connecting: road ids.
        at_start: the connecting road is entered at its start.
        lanes: lane of the connecting road by lane of the incoming road.
    """

    incoming: str
    connecting: str
    at_start: bool
    lanes: Mapping[int, int]


@dataclass(frozen=True, eq=False)
class RoadNetwork:
    """Roads and junctions of a file.

    Attributes:
        path: for messages.
        roads: by id.
        junctions: connections by junction id.
    """

    path: Path
    roads: Mapping[str, Road]
    junctions: Mapping[str, tuple[JunctionPath, ...]]

    def road(self, road_id: str) -> Road:
        """A road.

        Raises:
            OpenDriveError: there is none with this id.
        """
        if road_id not in self.roads:
            known = ", ".join(list(self.roads)[:8])
            raise OpenDriveError(f"{self.path}: has no road {road_id!r}; its roads: {known}")
        return self.roads[road_id]

    def location(self, road_id: str, lane: int, s_m: float, offset_m: float) -> RoadLocation:
        """A location on a lane, facing in the direction of its traffic.

        Raises:
            OpenDriveError: there is no such road or lane, or the road is shorter.
        """
        road = self.road(road_id)
        if not -_BEYOND_M <= s_m <= road.length_m + _BEYOND_M:
            raise OpenDriveError(
                f"{self.path}: road {road_id!r} is {road.length_m:g} m long, so it has no s = {s_m:g} m"
            )
        s_m = min(max(s_m, 0.0), road.length_m)
        road.lane_middle_m(s_m, lane)
        return RoadLocation(road_id, s_m, lane, offset_m, road.direction(s_m, lane))

    def adjacent_location(self, road_id: str, s_m: float, t_m: float) -> RoadLocation:
        """A location given by s and t, in the lane that is there."""
        road = self.road(road_id)
        lane = road.adjacent_lane(s_m, t_m)
        location = self.location(road_id, lane, s_m, 0.0)
        return replace(location, offset_m=t_m - road.lane_middle_m(location.s_m, lane))

    def lateral_m(self, location: RoadLocation) -> float:
        """Lateral position t of a location [m]."""
        road, s_m = self.road(location.road), location.s_m
        if road.lane_at(s_m, location.lane) is None and location.lane:  # the lane ends exactly here
            s_m -= location.travel * _END_M
        return road.lane_middle_m(s_m, location.lane) + location.offset_m

    def pose(self, location: RoadLocation) -> tuple[float, float, float, float]:
        """x, y, z [m] and heading [rad] of a vehicle that faces along its lane."""
        x, y, z, heading = self.road(location.road).pose(location.s_m, self.lateral_m(location))
        return x, y, z, heading + self._skew(location) + (0.0 if location.travel > 0 else math.pi)

    def _skew(self, location: RoadLocation) -> float:
        """Angle of the lane's middle against the reference line [rad]."""
        road = self.road(location.road)
        start, end = road.stretch(location.s_m, location.lane, location.travel)
        if road.lane_at(start + _END_M, location.lane) is None:
            return 0.0
        low, high = max(location.s_m - _NEAR_M, start + _END_M), min(location.s_m + _NEAR_M, end - _END_M)
        if high - low < _END_M:
            return 0.0
        change = road.lane_middle_m(high, location.lane) - road.lane_middle_m(low, location.lane)
        return math.atan2(change, high - low)

    def advance(self, location: RoadLocation, way_m: float) -> tuple[RoadLocation, float]:
        """The location reached along a lane, measured on the reference lines, in the direction of travel.

        Returns:
            The location, and the distance [m] that is left: above 0 where the lane ends before, or its way on is not
            unique.
        """
        left_m = way_m
        for _ in range(_MOST_ROADS):
            start, end = self.road(location.road).stretch(location.s_m, location.lane, location.travel)
            end = end if location.travel > 0 else start
            room_m = max((end - location.s_m) * location.travel, 0.0)
            if left_m <= room_m:
                return replace(location, s_m=location.s_m + location.travel * left_m), 0.0
            left_m -= room_m
            onward = self.onward(replace(location, s_m=end))
            if len(onward) != 1:
                return replace(location, s_m=end), left_m
            location = onward[0]
        return location, left_m

    def onward(self, location: RoadLocation) -> list[RoadLocation]:
        """Locations after the end of a lane: in the next section, road, or roads of a junction."""
        road = self.road(location.road)
        lane = road.lane_before(location.s_m, location.lane, location.travel)
        linked = None if lane is None else lane.successor if location.travel > 0 else lane.predecessor
        linked = 0 if location.lane == 0 else linked
        if 2 * _END_M < location.s_m < road.length_m - 2 * _END_M:
            return [] if linked is None else [replace(location, lane=linked)]
        link = road.successor if location.travel > 0 else road.predecessor
        if link is None:
            return []
        if link.kind == "junction":
            entered = self._through_junction(location, link)
        else:
            is_known = link.id in self.roads and linked is not None
            entered = [self._entered(location, link.id, link.at_start, linked or 0)] if is_known else []
        return [each for each in entered if self._exists(each)]

    def _exists(self, location: RoadLocation) -> bool:
        is_inside = self.road(location.road).lane_at(location.s_m + location.travel * _END_M, location.lane) is not None
        return location.lane == 0 or is_inside

    def _through_junction(self, location: RoadLocation, link: RoadLink) -> list[RoadLocation]:
        paths = [path for path in self.junctions.get(link.id, ()) if path.incoming == location.road]
        paths = [path for path in paths if path.connecting in self.roads]
        return [
            self._entered(location, path.connecting, path.at_start, path.lanes[location.lane])
            for path in paths
            if location.lane in path.lanes
        ]

    def _entered(self, location: RoadLocation, road_id: str, at_start: bool, lane: int) -> RoadLocation:
        travel = 1 if at_start else -1
        offset_m = location.offset_m * location.travel * travel
        return RoadLocation(road_id, 0.0 if at_start else self.road(road_id).length_m, lane, offset_m, travel)

    def locate(self, x_m: float, y_m: float) -> RoadLocation | None:
        """The location on the nearest road, facing in the direction of its lane; None beyond the ends of all roads."""
        names, samples, tree = self._samples
        if not names:
            return None
        row = int(tree.query([x_m, y_m])[1])
        road = self.roads[names[row]]
        s_m = float(samples[row])
        for _ in range(_NEWTON_STEPS):
            x, y, heading = road.plan_view.at(np.array([s_m]))[0].tolist()
            east, north = x_m - x, y_m - y
            along, t_m = (
                east * math.cos(heading) + north * math.sin(heading),
                north * math.cos(heading) - east * math.sin(heading),
            )
            s_m += along
        if not -_BEYOND_M <= s_m <= road.length_m + _BEYOND_M:
            return None
        return self.adjacent_location(road.id, min(max(s_m, 0.0), road.length_m), t_m)

    @cached_property
    def _samples(self) -> tuple[list[str], np.ndarray, KDTree]:
        from scipy.spatial import KDTree

        names: list[str] = []
        samples, points = [], []
        for road in self.roads.values():
            at = np.linspace(0, road.length_m, max(2, int(road.length_m / _STEP_M) + 1))
            names.extend([road.id] * len(at))
            samples.append(at)
            points.append(road.plan_view.at(at)[:, :2])
        return names, np.concatenate(samples), KDTree(np.concatenate(points))


def read_road_network(path: Path) -> RoadNetwork:
    """Roads and junctions of an OpenDRIVE file.

    Raises:
        OpenDriveError: the file cannot be read, or has no road.
    """
    try:
        root = read_xml(path, "OpenDRIVE")
    except TownError as error:
        raise OpenDriveError(str(error)) from error
    roads = {road.id: road for road in (read_road(path, element) for element in root.findall("road"))}
    if not roads:
        raise OpenDriveError(f"{path}: has no road")
    junctions = {
        element.get("id", ""): tuple(_path(path, each) for each in element.findall("connection"))
        for element in root.findall("junction")
    }
    return RoadNetwork(path, roads, junctions)


def _path(path: Path, element: ET.Element) -> JunctionPath:
    try:
        lanes = {int(link.attrib["from"]): int(link.attrib["to"]) for link in element.findall("laneLink")}
    except (KeyError, ValueError) as error:
        raise OpenDriveError(f"{path}: a laneLink has no whole numbers `from` and `to` ({error})") from error
    connecting = element.get("connectingRoad") or element.get("linkedRoad", "")
    at_start = element.get("contactPoint", "start") == "start"
    return JunctionPath(element.get("incomingRoad", ""), connecting, at_start, lanes)
