"""A town in figures."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from assets.streets import StreetLane
from sumo_nets import Town

_SHORTEST_RUN_M = 0.3  # shorter pieces of a lane say nothing of its grade


@dataclass(frozen=True)
class TownFacts:
    """Figures of a town's streets.

    Attributes:
        junctions: where three or more ways meet, or two streets end.
        lane_km: driving lanes outside junctions.
        sidewalk_km: sidewalks.
        lights: junctions with traffic lights.
        crossings: pedestrian crossings.
        parking_lots: kerbside parking spaces.
        extent_m: size from west to east and from south to north.
        height_m: lowest to highest point of a lane.
        max_grade_percent: steepest piece of a driving lane, rise over run.
        lanes: count of edges by their number of driving lanes.
        limits_km: driving-lane length [km] by speed limit [km/h].
    """

    junctions: int
    lane_km: float
    sidewalk_km: float
    lights: int
    crossings: int
    parking_lots: int
    extent_m: tuple[float, float]
    height_m: float
    max_grade_percent: float
    lanes: dict[int, int]
    limits_km: dict[int, float]


def town_facts(town: Town) -> TownFacts:
    """Count and measure a town's streets."""
    streets = town.streets
    driving = [lane for lane in streets.lanes if lane.use == "drive" and not lane.internal]
    points = np.concatenate([lane.centre for lane in streets.lanes])
    extent = np.ptp(points[:, :2], axis=0)
    limits: dict[int, float] = {}
    for lane in driving:
        limit = round(lane.speed_mps * 3.6)
        limits[limit] = limits.get(limit, 0.0) + _length_m(lane) / 1000
    lanes_of_edge = Counter(lane.edge for lane in driving)
    return TownFacts(
        junctions=sum(area.use == "junction" and "_" not in area.id and "#" not in area.id for area in streets.areas),
        lane_km=sum(_length_m(lane) for lane in driving) / 1000,
        sidewalk_km=sum(_length_m(lane) for lane in streets.lanes if lane.use == "sidewalk") / 1000,
        lights=_signalled_junctions(town, streets.lanes),
        crossings=sum(lane.use == "crossing" for lane in streets.lanes),
        parking_lots=len(streets.parking),
        extent_m=(float(extent[0]), float(extent[1])),
        height_m=float(np.ptp(points[:, 2])),
        max_grade_percent=100 * max(_steepest(lane) for lane in driving),
        lanes=dict(sorted(Counter(lanes_of_edge.values()).items())),
        limits_km=dict(sorted(limits.items())),
    )


def _length_m(lane: StreetLane) -> float:
    return float(np.linalg.norm(np.diff(lane.centre[:, :2], axis=0), axis=1).sum())


def _steepest(lane: StreetLane) -> float:
    step = np.diff(lane.centre, axis=0)
    run = np.linalg.norm(step[:, :2], axis=1)
    long = run > _SHORTEST_RUN_M
    return float((np.abs(step[long, 2]) / run[long]).max(initial=0.0))


def _signalled_junctions(town: Town, lanes: tuple[StreetLane, ...]) -> int:
    """Count the junctions at which some lane ends at a signal."""
    areas = [area for area in town.streets.areas if area.use == "junction" and "_" not in area.id]
    middles = np.array([area.outline[:, :2].mean(axis=0) for area in areas])
    lines = [line.position[:2] for line in town.streets.stop_lines if line.control == "signal"]
    return len({int(np.linalg.norm(middles - line, axis=1).argmin()) for line in lines})
