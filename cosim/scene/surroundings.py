"""The part of a large town's streets that lies within sight of a route.

The world of a town is built as a whole if its lanes are short enough. Of a larger network, only the surroundings of
the ego vehicle's route are built, because time and memory grow with the length of the lanes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from assets.streets import StreetLane, Streets
from sensors.cameras.renderer import FAR_M

SIGHT_M = FAR_M  # of the cameras
LARGE_M = 50_000.0  # length of all lanes; the built-in towns have 15 to 35 km
_STEP_M = 50.0  # positions that are nearer to each other share a disc
_BEYOND_M = 60.0  # lanes are built this much farther than one can see
BUILT_M = SIGHT_M + _STEP_M + _BEYOND_M  # extent of a world with images beside its route


def is_large(streets: Streets) -> bool:
    """Whether only the surroundings of a route are built."""
    return lane_length_m(streets) > LARGE_M


def lane_length_m(streets: Streets) -> float:
    """Length of all lanes [m]."""
    points = np.concatenate([lane.centre[:, :2] for lane in streets.lanes])
    last = np.cumsum([len(lane.centre) for lane in streets.lanes])[:-1] - 1
    return float(np.delete(np.hypot(*np.diff(points, axis=0).T), last).sum())


def surroundings(streets: Streets, route: np.ndarray, sight_m: float) -> Streets:
    """Streets within sight of a route.

    Lanes that lead out of sight are cut behind the limit of sight. If the town's files define buildings, the result
    has no random buildings either, even if none of those buildings is in sight.

    Args:
        streets: streets of the town.
        route: (n, 2) positions along the route, in the town's axes [m].
        sight_m: limit of sight from each position [m].

    Raises:
        ValueError: no lane is within sight.
    """
    seen: Any = shapely.union_all(shapely.buffer(shapely.points(_thinned(route)), sight_m + _STEP_M, quad_segs=8))
    built = shapely.buffer(seen, _BEYOND_M)
    shapely.prepare([seen, built])
    lines = [_line(lane.centre) for lane in streets.lanes]
    lanes = [
        _cut(lane, line, built)
        for lane, line, is_seen in zip(streets.lanes, lines, shapely.intersects(seen, lines), strict=True)
        if is_seen
    ]
    if not lanes:
        raise ValueError(f"{streets.name}: no lane lies within {sight_m:g} m of the route")
    names = {lane.id for lane in lanes}
    return replace(
        streets,
        lanes=tuple(lanes),
        areas=tuple(area for area in streets.areas if seen.intersects(_line(area.outline))),
        parking=tuple(bay for bay in streets.parking if seen.intersects(_line(bay.centre))),
        stop_lines=tuple(
            stop for stop in streets.stop_lines if stop.lane in names and seen.covers(shapely.Point(stop.position[:2]))
        ),
        buildings=tuple(house for house in streets.buildings if seen.intersects(_line(house.outline))),
        trees=tuple(tree for tree in streets.trees if seen.covers(shapely.Point(tree))),
        has_buildings=streets.has_buildings or bool(streets.buildings),
    )


def _thinned(route: np.ndarray) -> np.ndarray:
    """Positions of a route (k, 2), of which each is a step away from those before it."""
    kept = route[:1]
    for position in route[1:]:
        if np.linalg.norm(kept - position, axis=1).min() > _STEP_M:
            kept = np.concatenate([kept, position[None]])
    return kept


def _cut(lane: StreetLane, line: shapely.LineString, region: shapely.Geometry) -> StreetLane:
    """A lane from its first to its last position within a region."""
    if shapely.covers(region, line):
        return lane
    parts = shapely.get_parts(shapely.intersection(line, region))
    ends = shapely.line_locate_point(line, shapely.points(shapely.get_coordinates(parts)))
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lane.centre[:, :2], axis=0), axis=1))])
    first, last = float(ends.min()), float(ends.max())
    if last - first < 0.1:
        return lane
    stations = np.concatenate([[first], along[(along > first) & (along < last)], [last]])
    centre = np.column_stack([np.interp(stations, along, lane.centre[:, axis]) for axis in range(3)])
    return replace(lane, centre=centre)


def _line(points: np.ndarray) -> shapely.LineString:
    """A polyline or outline (k, 2 or 3) in the plane, also of a single point."""
    return shapely.LineString(points[:, :2] if len(points) > 1 else np.repeat(points[:, :2], 2, axis=0))
