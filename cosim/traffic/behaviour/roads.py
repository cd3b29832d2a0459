"""The network as drivers use it: speed limits, corners, neighbouring lanes, the way back, parking spaces."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType

import numpy as np

from cosim.traffic.motion.corners import corner_speed
from sumo_nets.lanes import RAILWAYS, TRAMS
from sumo_nets.parking import read_angled_parking

_ON_FOOT = ("pedestrian",)
_ON_RAILS = TRAMS | RAILWAYS


@dataclass(frozen=True, eq=False)
class Lane:
    """A lane.

    Attributes:
        id, edge: SUMO's names.
        index: from the right.
        length_m: as SUMO counts positions.
        limit_mps: its limit, corners included.
        width_m: its width.
        shape: (k, 2) middle line, world metres.
        onward: next edge → limit of the slowest lane across the junction on the way there.
    """

    id: str
    edge: str
    index: int
    length_m: float
    limit_mps: float
    width_m: float
    shape: np.ndarray
    onward: dict[str, float]

    def point(self, position_m: float) -> tuple[np.ndarray, float]:
        """World place (2,) and heading [rad] at a position along the lane."""
        way = self._way_m
        at = float(np.clip(position_m / self.length_m, 0, 1) * way[-1])
        i = min(int(np.searchsorted(way, at, side="right")) - 1, len(way) - 2)
        piece = self.shape[i + 1] - self.shape[i]
        heading = float(np.arctan2(piece[1], piece[0]))
        return self.shape[i] + piece * (at - way[i]) / max(way[i + 1] - way[i], 1e-9), heading

    def project(self, point: np.ndarray) -> tuple[float, float]:
        """Position along the lane nearest to a place (2,), and how far the place lies to the left [m]."""
        start, (piece, length) = self.shape[:-1], self._pieces
        share = np.clip(np.einsum("ij,ij->i", point - start, piece) / np.maximum(length, 1e-9) ** 2, 0, 1)
        away = point - (start + share[:, None] * piece)
        i = int(np.argmin(np.hypot(away[:, 0], away[:, 1])))
        left = (piece[i, 0] * away[i, 1] - piece[i, 1] * away[i, 0]) / max(length[i], 1e-9)
        way = self._way_m
        return float((way[i] + share[i] * length[i]) * self.length_m / way[-1]), float(left)

    @cached_property
    def _pieces(self) -> tuple[np.ndarray, np.ndarray]:
        """Pieces (k − 1, 2) of the middle line, and their lengths (k − 1,) [m]."""
        piece = np.diff(self.shape, axis=0)
        return piece, np.hypot(piece[:, 0], piece[:, 1])

    @cached_property
    def _way_m(self) -> np.ndarray:
        """Distances (k,) of the points of the middle line from its start, along it [m]."""
        return _way(self.shape)


@dataclass(frozen=True)
class ParkingSpace:
    """A parking space next to a lane, from `start_m` to `end_m` along it."""

    id: str
    lane: str
    start_m: float
    end_m: float


class Roads:
    """Reads the running simulation's network once.

    Args:
        api: libsumo or a TraCI connection.

    Attributes:
        lots: parking spaces by lane, without those in which SUMO parks vehicles at an angle.
    """

    def __init__(self, api: ModuleType) -> None:
        self.lanes: dict[str, Lane] = {}
        closed: dict[str, list[tuple[int, float]]] = {}
        for name in api.lane.getIDList():
            allowed = api.lane.getAllowed(name)
            edge = api.lane.getEdgeID(name)
            index = int(name.rsplit("_", 1)[1])
            if tuple(allowed) == _ON_FOOT or (allowed and _ON_RAILS.issuperset(allowed)):
                continue
            if not allowed and "passenger" in api.lane.getDisallowed(name):
                closed.setdefault(edge, []).append((index, api.lane.getWidth(name)))
                continue
            self.lanes[name] = Lane(
                id=name,
                edge=edge,
                index=index,
                length_m=api.lane.getLength(name),
                limit_mps=api.lane.getMaxSpeed(name),
                width_m=api.lane.getWidth(name),
                shape=np.array(api.lane.getShape(name), float)[:, :2],
                onward={},
            )
        self.turnarounds: dict[str, Lane] = {}
        for lane in self.lanes.values():
            for link in api.lane.getLinks(lane.id):
                target, via = link[0], link[4]
                if link[6] == "t" and target in self.lanes and not lane.edge.startswith(":"):
                    self.turnarounds[via] = self.lanes[target]
                if target in self.lanes:
                    slow = min(self.lanes[target].limit_mps, self._across(api, via))
                    edge = self.lanes[target].edge
                    lane.onward[edge] = min(slow, lane.onward.get(edge, np.inf))
        self.bends = {lane.id: corner_speed(lane.shape) for lane in self.lanes.values()}
        self.of_edge: dict[str, list[Lane]] = {}
        for lane in self.lanes.values():
            self.of_edge.setdefault(lane.edge, []).append(lane)
        for lanes in self.of_edge.values():
            lanes.sort(key=lambda lane: lane.index)
        self.strip_m = {edge: sum(width for _, width in lanes) for edge, lanes in closed.items()}
        self.back = self._ways_back(api)
        additional = api.simulation.getOption("additional-files").split(",")
        self.lots = self._lots(api, read_angled_parking(Path(name) for name in additional if name))

    def right_room(self, edge: str) -> float:
        """Width of the parking strip on an edge's right [m]."""
        return self.strip_m.get(edge, 0.0)

    def _across(self, api: ModuleType, via: str) -> float:
        slowest = np.inf
        for _ in range(4):
            if via not in self.lanes:
                break
            slowest = min(slowest, self.lanes[via].limit_mps)
            links = api.lane.getLinks(via)
            via = links[0][4] if links else ""
        return float(slowest)

    def _ways_back(self, api: ModuleType) -> dict[str, str]:
        ends = {
            edge: (api.edge.getFromJunction(edge), api.edge.getToJunction(edge))
            for edge in self.of_edge
            if not edge.startswith(":")
        }
        by_ends = {pair: edge for edge, pair in sorted(ends.items())}
        return {edge: by_ends[b, a] for edge, (a, b) in ends.items() if (b, a) in by_ends}

    def _lots(self, api: ModuleType, angled_parking: Collection[str]) -> dict[str, list[ParkingSpace]]:
        lots: dict[str, list[ParkingSpace]] = {}
        for name in sorted(api.parkingarea.getIDList()):
            lane = api.parkingarea.getLaneID(name)
            lot = ParkingSpace(name, lane, api.parkingarea.getStartPos(name), api.parkingarea.getEndPos(name))
            if lane in self.lanes and name not in angled_parking:
                lots.setdefault(self.lanes[lane].edge, []).append(lot)
        for places in lots.values():
            places.sort(key=lambda lot: lot.start_m)
        return lots


def _way(shape: np.ndarray) -> np.ndarray:
    pieces = np.diff(shape, axis=0)
    return np.concatenate([[0.0], np.cumsum(np.hypot(pieces[:, 0], pieces[:, 1]))])
