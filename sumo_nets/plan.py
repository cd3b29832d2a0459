"""The street plan: which junctions and streets a town has, before SUMO gives them lanes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sumo_nets.recipe import StreetRules

LOCAL_PRIORITY, MAIN_PRIORITY, CIRCLE_PRIORITY, RAMP_PRIORITY, FAST_PRIORITY = 1, 3, 4, 2, 6


@dataclass(frozen=True)
class Road:
    """Cross section of one direction of a street.

    Attributes:
        lanes: driving lanes.
        lane_width_m: width of each.
        speed_kmh: limit.
        priority: right of way over streets of lower numbers.
        sidewalk: whether there is one on the right.
        oneway: whether traffic runs from start to end only.
        bicycles: whether they are allowed.
        median_m: distance of the two directions' left-most lanes.
    """

    lanes: int
    lane_width_m: float
    speed_kmh: float
    priority: int
    sidewalk: bool = True
    oneway: bool = False
    bicycles: bool = True
    median_m: float = 0.0


@dataclass(frozen=True)
class Street:
    """A street between two junctions.

    Attributes:
        start, end: junction numbers.
        shape: (k, 2) its middle line from start to end, world metres; the left edge of a one-way street.
        main: a main street, with more lanes and a higher limit.
        parking: parking strips on the right, driving from start to end and from end to start.
        slanted: whether their bays are slanted.
        road: its cut where it is neither that of main nor of local streets; such a street is not changed.
    """

    start: int
    end: int
    shape: np.ndarray
    main: bool = False
    parking: tuple[bool, bool] = (False, False)
    slanted: tuple[bool, bool] = (False, False)
    road: Road | None = None


@dataclass(frozen=True)
class Link:
    """A way from a lane of one edge to a lane of the next, not left to netconvert; lanes count from the right."""

    edge: str
    to_edge: str
    lane: int
    to_lane: int


@dataclass(frozen=True)
class Plan:
    """Junctions and streets.

    Attributes:
        names: junction ids.
        positions: (n, 2) junctions, world metres, centred on the origin.
        streets: what joins them.
        controls: SUMO junction type of those junctions that do not follow the rules.
        links: lane connections that do not either.
        closed: prohibited turns from one edge to another.
        radii: turning radius of corners [m] at junctions that are wider than others.
        tracks: edges with tram tracks in their innermost lane.
    """

    names: tuple[str, ...]
    positions: np.ndarray
    streets: tuple[Street, ...]
    controls: Mapping[str, str] = field(default_factory=dict)
    links: tuple[Link, ...] = ()
    closed: tuple[tuple[str, str], ...] = ()
    radii: Mapping[str, float] = field(default_factory=dict)
    tracks: frozenset[str] = frozenset()

    def arms(self, main_only: bool = False) -> np.ndarray:
        """Return how many (main) streets meet at each junction, (n,) int."""
        ends = [node for s in self.streets if s.main or not main_only for node in (s.start, s.end)]
        return np.bincount(np.array(ends, dtype=np.int64), minlength=len(self.names))

    def edge(self, street: Street, forward: bool = True) -> str:
        """Return the SUMO edge id of one direction of a street."""
        ends = (street.start, street.end) if forward else (street.end, street.start)
        return "_".join(self.names[node] for node in ends)


def road_of(street: Street, rules: StreetRules) -> Road:
    """Return how a street is cut: its own way, or that of the town's main or local streets."""
    if street.road is not None:
        return street.road
    if street.main:
        return Road(rules.main_lanes, rules.lane_width_m, rules.main_speed_kmh, MAIN_PRIORITY, median_m=rules.median_m)
    return Road(1, rules.lane_width_m, rules.local_speed_kmh, LOCAL_PRIORITY)
