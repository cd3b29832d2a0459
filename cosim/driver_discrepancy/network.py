"""A town's road network as trajectories need it: lanes, limits, ways on and ways back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from cosim.driver_discrepancy.settings import DEFAULT
from cosim.traffic.motion.corners import corner_speed
from cosim.traffic.road_users import KIND_OF_CLASS
from sumo_nets.xml_guard import read_xml

_BY = DEFAULT.placing


@dataclass(frozen=True, eq=False)
class NetLane:
    """A lane of cars.

    Attributes:
        id, edge, index: SUMO's names; lanes are counted from the right.
        limit_mps, length_m, width_m: as the network has them.
        shape: (k, 2) middle line, world metres.
        inside: it lies inside a junction.
        straight: bool, whether its bends do not limit the speed.
    """

    id: str
    edge: str
    index: int
    limit_mps: float
    length_m: float
    width_m: float
    shape: np.ndarray
    inside: bool
    straight: bool

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions along the lane (n,) and how far points (n, 2) lie to its left (n,) [m]."""
        start, piece = self.shape[:-1], np.diff(self.shape, axis=0)
        length = np.maximum(np.hypot(piece[:, 0], piece[:, 1]), 1e-9)
        way = np.concatenate([[0.0], np.cumsum(length)])
        away = points[:, None, :] - start
        share = np.clip(np.einsum("nij,ij->ni", away, piece) / length**2, 0, 1)
        apart = away - share[..., None] * piece
        best = np.argmin(np.einsum("nij,nij->ni", apart, apart), axis=1)
        rows = np.arange(len(points))
        left = (piece[best, 0] * apart[rows, best, 1] - piece[best, 1] * apart[rows, best, 0]) / length[best]
        along = way[best] + share[rows, best] * length[best]
        return along * self.length_m / way[-1], left


@dataclass(frozen=True)
class NetType:
    """A vehicle type: its kind (`car`, `van`, …), length [m] and SUMO's attributes as written."""

    kind: str
    length_m: float
    attributes: Mapping[str, str]


@dataclass(frozen=True)
class LaneLink:
    """A way from a lane to the next.

    Attributes:
        target, via: ids of the next lane and of the first lane inside the junction; `via` may be empty.
        signal, index: traffic light and its link index; empty and −1 without one.
        direction: SUMO's letter: s, l, r, L, R, t.
        has_priority: no other stream goes first.
    """

    target: str
    via: str
    signal: str
    index: int
    direction: str
    has_priority: bool


@dataclass(frozen=True)
class SignalProgram:
    """A fixed-time signal program: offset [s], durations of its phases (k,) [s] and their states."""

    offset_s: float
    durations_s: tuple[float, ...]
    states: tuple[str, ...]

    @property
    def cycle_s(self) -> float:
        """Duration of a cycle."""
        return sum(self.durations_s)


@dataclass(frozen=True, eq=False)
class Network:
    """A network, indexed by SUMO's names.

    Attributes:
        lanes: of cars, those inside junctions too.
        others: ids of lanes that are not for cars.
        onward: edge → edges that a car may take next, turning back included.
        back: edge → the edge of the other direction.
        lots: parking area → its lane, start and end along it [m].
        types: vType → kind, length and attributes.
        links: lane → ways on.
        yields_to: lane inside a junction → lanes inside it to which its vehicles must yield.
        programs: traffic light → its fixed-time program; actuated ones are left out.
    """

    lanes: dict[str, NetLane]
    others: frozenset[str]
    onward: dict[str, tuple[str, ...]]
    back: dict[str, str]
    lots: dict[str, tuple[str, float, float]]
    types: dict[str, NetType]
    links: dict[str, tuple[LaneLink, ...]] = field(default_factory=dict)
    yields_to: dict[str, tuple[str, ...]] = field(default_factory=dict)
    programs: dict[str, SignalProgram] = field(default_factory=dict)

    def lanes_of(self, edge: str) -> list[NetLane]:
        """Lanes of cars of an edge, from the right."""
        return sorted((lane for lane in self.lanes.values() if lane.edge == edge), key=lambda lane: lane.index)

    def nearest(self, position: np.ndarray) -> NetLane:
        """The lane nearest to a place (2,)."""
        streets = [lane for lane in self.lanes.values() if not lane.inside]
        apart = [float(np.min(np.hypot(*(_dense(lane.shape) - position).T))) for lane in streets]
        return streets[int(np.argmin(apart))]

    def way(self, one: str, other: str, longest: int = 6) -> list[str]:
        """Edges from one to another, both included; empty if there is no way of so many edges."""
        ways = [[one]]
        seen = {one}
        for _ in range(longest):
            found = [[*way, on] for way in ways for on in self.onward.get(way[-1], ()) if on not in seen]
            for way in found:
                if way[-1] == other:
                    return way
            seen.update(way[-1] for way in found)
            ways = found
        return []


def read_network(net: Path, additional: tuple[Path, ...], routes: tuple[Path, ...] = ()) -> Network:
    """Read a network with its vehicle types and parking areas.

    Raises:
        TownError: a file cannot be read.
    """
    root = read_xml(net, "net")
    lanes: dict[str, NetLane] = {}
    others: set[str] = set()
    ends: dict[str, tuple[str, str]] = {}
    for edge in root.iter("edge"):
        name, function = edge.get("id", ""), edge.get("function", "")
        for lane in edge.iter("lane"):
            if not _for_cars(lane.get("allow"), lane.get("disallow")) or function in ("crossing", "walkingarea"):
                others.add(lane.get("id", ""))
                continue
            shape = np.array([[float(v) for v in p.split(",")[:2]] for p in lane.get("shape", "").split()])
            limit = float(lane.get("speed", _BY.usual_limit_mps))
            lanes[lane.get("id", "")] = NetLane(
                id=lane.get("id", ""),
                edge=name,
                index=int(lane.get("index", 0)),
                limit_mps=limit,
                length_m=float(lane.get("length", 0)),
                width_m=float(lane.get("width", 3.2)),
                shape=shape,
                inside=function == "internal",
                straight=corner_speed(shape) > _BY.straight * limit,
            )
        if not function:
            ends[name] = (edge.get("from", ""), edge.get("to", ""))
    onward: dict[str, set[str]] = {}
    for link in root.iter("connection"):
        source, target = link.get("from", ""), link.get("to", "")
        if f"{source}_{link.get('fromLane')}" in lanes and f"{target}_{link.get('toLane')}" in lanes:
            onward.setdefault(source, set()).add(target)
    by_ends = {pair: edge for edge, pair in sorted(ends.items())}
    back = {edge: by_ends[b, a] for edge, (a, b) in ends.items() if (b, a) in by_ends}
    ways = {edge: tuple(sorted(found)) for edge, found in onward.items() if not edge.startswith(":")}
    lots, types = _furniture((*additional, *routes))
    junctions = _links(root, lanes), _yields(root), _programs(root)
    return Network(lanes, frozenset(others), ways, back, lots, types, *junctions)


def _links(root: Element, lanes: Mapping[str, NetLane]) -> dict[str, tuple[LaneLink, ...]]:
    found: dict[str, list[LaneLink]] = {}
    for link in root.iter("connection"):
        source = f"{link.get('from', '')}_{link.get('fromLane')}"
        target = f"{link.get('to', '')}_{link.get('toLane')}"
        if source in lanes and target in lanes:
            state = link.get("state", "M")
            index = int(link.get("linkIndex", -1)) if link.get("tl") else -1
            via, signal, turn = link.get("via", ""), link.get("tl", ""), link.get("dir", "s")
            found.setdefault(source, []).append(LaneLink(target, via, signal, index, turn, state.isupper()))
    return {lane: tuple(links) for lane, links in found.items()}


def _yields(root: Element) -> dict[str, tuple[str, ...]]:
    found = {}
    for junction in root.iter("junction"):
        inside = junction.get("intLanes", "").split()
        for request in junction.iter("request"):
            index, bits = int(request.get("index", -1)), request.get("response", "")[::-1]
            if 0 <= index < len(inside):
                found[inside[index]] = tuple(lane for lane, bit in zip(inside, bits, strict=False) if bit == "1")
    return found


def _programs(root: Element) -> dict[str, SignalProgram]:
    found = {}
    for logic in root.iter("tlLogic"):
        phases = logic.findall("phase")
        if logic.get("type", "static") == "static" and phases:
            durations = tuple(float(phase.get("duration", 0)) for phase in phases)
            offset = logic.get("offset", "0")
            states = tuple(phase.get("state", "") for phase in phases)
            found[logic.get("id", "")] = SignalProgram(float(offset) if offset != "begin" else 0.0, durations, states)
    return found


def _furniture(files: tuple[Path, ...]) -> tuple[dict[str, tuple[str, float, float]], dict[str, NetType]]:
    lots: dict[str, tuple[str, float, float]] = {}
    types: dict[str, NetType] = {}
    for path in files:
        root = read_xml(path, "additional", "routes")
        for lot in root.iter("parkingArea"):
            ends = float(lot.get("startPos", 0)), float(lot.get("endPos", 0))
            lots[lot.get("id", "")] = (lot.get("lane", ""), *ends)
        for vtype in root.iter("vType"):
            kind = KIND_OF_CLASS.get(vtype.get("vClass", "passenger"), "")
            attributes = {key: value for key, value in vtype.attrib.items() if key != "id"}
            types[vtype.get("id", "")] = NetType(kind, float(vtype.get("length", 5.0)), attributes)
    return lots, types


def _for_cars(allow: str | None, disallow: str | None) -> bool:
    if allow is not None:
        return allow == "all" or "passenger" in allow.split()
    return disallow is None or not ({"all", "passenger"} & set(disallow.split()))


def _dense(shape: np.ndarray) -> np.ndarray:
    """Points every few metres along a line."""
    pieces = []
    for a, b in pairwise(shape):
        count = max(int(np.hypot(*(b - a)) / 4), 1)
        pieces.append(a + (b - a) * np.arange(count + 1)[:, None] / count)
    return np.concatenate(pieces)
