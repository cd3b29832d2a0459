"""A town inside a fast ring road of two carriageways, joined to it by signalled gates and merging ramps.

Traffic keeps right: the inner carriageway runs clockwise and has the town on its right, the outer one runs
counter-clockwise and has the open country. So ramps lead from the inner one to the ends of the town's streets,
and from the outer one to service roads with parking.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np

from sumo_nets.plan import FAST_PRIORITY, RAMP_PRIORITY, Link, Plan, Road, Street
from sumo_nets.recipe import RingRoadLayout, StreetRules

_RAMP_M = 95.0  # along the ring, from the ramp's nose to its other end
_SPEED_CHANGE_M = 75.0  # length of the lanes to merge on and to slow down on
_RAMP_DEPTH_M = 48.0  # from the ring to the ramp's other end
_SERVICE_M = 60.0
_SHAPE_STEP_M = 8.0


def ring_road(layout: RingRoadLayout, rules: StreetRules) -> Plan:
    """Return the plan: a web of streets inside, the ring around it."""
    draft = _Draft(layout, rules)
    rims = _web(draft)
    for carriageway in (-1, 1):
        stops = sorted(stop for arm in range(layout.arms) for stop in _stops(draft, rims, arm, carriageway))
        for (_, _, leave), (_, arrive, _) in zip(stops, [*stops[1:], *stops[:1]], strict=True):
            draft.carriageway(leave, arrive, carriageway, extra=0)
    return draft.plan()


@dataclass
class _Draft:
    """A plan under construction; points are polar, angles in the direction of travel."""

    layout: RingRoadLayout
    rules: StreetRules
    names: list[str] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)
    streets: list[Street] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    controls: dict[str, str] = field(default_factory=dict)

    def node(self, name: str, radius_m: float, angle: float, control: str | None = None) -> int:
        """Add a junction."""
        self.names.append(name)
        self.points.append(_polar(radius_m, angle))
        if control:
            self.controls[name] = control
        return len(self.names) - 1

    def angle(self, node: int) -> float:
        """Return the direction of a junction from the middle of the town."""
        x, y = self.points[node]
        return float(np.arctan2(y, x))

    def inner_edge_m(self, side: int) -> float:
        """Return the radius of the left edge of a carriageway: −1 the inner, +1 the outer one."""
        return self.layout.radius_m + side * self.layout.median_m / 2

    def carriageway(self, start: int, end: int, side: int, extra: int) -> Street:
        """Add a piece of carriageway with `extra` lanes on the right; returns it."""
        a, b = self.angle(start), self.angle(end)
        turn = (side * (b - a)) % (2 * np.pi)
        radius = self.inner_edge_m(side)
        at = a + side * np.linspace(0, turn, max(2, int(np.ceil(turn * radius / _SHAPE_STEP_M)) + 1))
        lanes, width = self.layout.lanes + extra, self.rules.lane_width_m
        road = Road(lanes, width, self.layout.speed_kmh, FAST_PRIORITY, sidewalk=False, oneway=True, bicycles=False)
        return self.add(Street(start, end, np.array([_polar(radius, angle) for angle in at]), road=road))

    def add(self, street: Street) -> Street:
        """Add a street; returns it."""
        self.streets.append(street)
        return street

    def join(self, a: Street, b: Street, lanes: list[tuple[int, int]]) -> None:
        """Connect lanes of a street with lanes of the next."""
        self.links += [Link(self._id(a), self._id(b), lane, to_lane) for lane, to_lane in lanes]

    def plan(self) -> Plan:
        """Return the finished plan."""
        return Plan(tuple(self.names), np.array(self.points), tuple(self.streets), self.controls, tuple(self.links))

    def _id(self, street: Street) -> str:
        return f"{self.names[street.start]}_{self.names[street.end]}"


def _web(draft: _Draft) -> list[int]:
    """Add the streets inside the ring; returns the outermost junction of every arm."""
    layout = draft.layout
    step = 2 * np.pi / layout.arms
    rings = [
        [draft.node(f"{chr(65 + arm)}{ring}", radius, arm * step) for arm in range(layout.arms)]
        for ring, radius in enumerate(layout.circles_m)
    ]
    for number, ring in enumerate(rings):
        for arm, (start, end) in enumerate(zip(ring, [*ring[1:], ring[0]], strict=True)):
            radius = layout.circles_m[number]
            along = arm * step + np.linspace(0, step, max(3, int(np.ceil(step * radius / _SHAPE_STEP_M)) + 1))
            shape = np.array([_polar(radius, angle) for angle in along])
            draft.add(Street(start, end, shape, main=number == len(rings) - 1))
    for inner, outer in itertools.pairwise(rings):
        for arm, (start, end) in enumerate(zip(inner, outer, strict=True)):
            main = arm in layout.gates or arm in layout.ramps
            draft.add(Street(start, end, np.array([draft.points[start], draft.points[end]]), main=main))
    return rings[-1]


def _stops(draft: _Draft, rims: list[int], arm: int, side: int) -> list[tuple[float, int, int]]:
    """Return what a carriageway meets at an arm: place in travel direction, first junction, last junction."""
    layout = draft.layout
    middle = 2 * np.pi * arm / layout.arms
    if arm in layout.gates:
        gate = _gate(draft, rims[arm], arm)
        return [(side * middle % (2 * np.pi), gate, gate)]
    if side < 0 and arm in layout.ramps:
        end = draft.node(f"end{arm}", layout.radius_m - _RAMP_DEPTH_M - layout.median_m, middle, "priority")
        draft.add(Street(rims[arm], end, _straight(draft, rims[arm], end), main=True))
        return [_interchange(draft, f"in{arm}", middle, side, end, end)]
    if side > 0 and arm in layout.services:
        radius = layout.radius_m + _RAMP_DEPTH_M
        half = _SERVICE_M / 2 / radius
        first, last = (
            draft.node(f"service{arm}{k}", radius, middle + t, "priority") for k, t in (("a", -half), ("b", half))
        )
        road = Road(1, 4.0, 30.0, RAMP_PRIORITY, sidewalk=False, oneway=True)
        at = middle + np.linspace(-half, half, 8)
        shape = np.array([_polar(radius, angle) for angle in at])
        draft.add(Street(first, last, shape, parking=(True, False), road=road))
        return [_interchange(draft, f"out{arm}", middle, side, first, last)]
    return []


def _gate(draft: _Draft, rim: int, arm: int) -> int:
    """Add, or find again, the signalled junction where a main street meets the ring."""
    name = f"gate{arm}"
    if name in draft.names:
        return draft.names.index(name)
    gate = draft.node(name, draft.layout.radius_m, 2 * np.pi * arm / draft.layout.arms, "traffic_light")
    draft.add(Street(rim, gate, _straight(draft, rim, gate), main=True))
    return gate


def _interchange(
    draft: _Draft, name: str, middle: float, side: int, exit_to: int, entry_from: int
) -> tuple[float, int, int]:
    """Add the ramps that leave for one junction and come back from another, with their lanes to change speed on."""
    radius, lanes = draft.inner_edge_m(side), draft.layout.lanes
    half = float(np.linalg.norm(draft.points[exit_to] - draft.points[entry_from])) / 2
    nose, ahead = (_RAMP_M + half) / radius, (_RAMP_M + half + _SPEED_CHANGE_M) / radius
    places = zip("abcd", (-ahead, -nose, nose, ahead), strict=True)
    a, b, c, d = (draft.node(name + key, radius, middle + side * at, "priority") for key, at in places)
    slow = draft.carriageway(a, b, side, extra=1)
    through = draft.carriageway(b, c, side, extra=0)
    merge = draft.carriageway(c, d, side, extra=1)
    edge = radius + side * lanes * draft.rules.lane_width_m
    road = Road(1, 3.8, 50.0, RAMP_PRIORITY, sidewalk=False, oneway=True, bicycles=False)
    tangent = side * np.array([-np.sin(middle), np.cos(middle)])
    leaving = _curve(
        _polar(edge, middle - side * nose), _heading(middle - side * nose, side), draft.points[exit_to], tangent
    )
    coming = _curve(
        draft.points[entry_from], tangent, _polar(edge, middle + side * nose), _heading(middle + side * nose, side)
    )
    off = draft.add(Street(b, exit_to, leaving, road=road))
    on = draft.add(Street(entry_from, c, coming, road=road))
    rest = [(lane + 1, lane) for lane in range(lanes)]
    draft.join(slow, off, [(0, 0)])
    draft.join(slow, through, rest)
    draft.join(on, merge, [(0, 0)])
    draft.join(through, merge, [(lane, wide) for wide, lane in rest])
    return side * middle % (2 * np.pi), a, d


def _straight(draft: _Draft, start: int, end: int) -> np.ndarray:
    return np.array([draft.points[start], draft.points[end]])


def _heading(angle: float, side: int) -> np.ndarray:
    return side * np.array([-np.sin(angle), np.cos(angle)])


def _curve(start: np.ndarray, start_way: np.ndarray, end: np.ndarray, end_way: np.ndarray) -> np.ndarray:
    """Return a cubic Bézier curve (k, 2) between two points with given directions of travel."""
    reach = 0.4 * np.linalg.norm(end - start)
    t = np.linspace(0, 1, 14)[:, None]
    points = start, start + reach * start_way, end - reach * end_way, end
    weights = np.stack([(1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t**2, t**3])
    return (weights * np.array(points)[:, None]).sum(axis=0)


def _polar(radius_m: float, angle: float) -> np.ndarray:
    return radius_m * np.array([np.cos(angle), np.sin(angle)])
