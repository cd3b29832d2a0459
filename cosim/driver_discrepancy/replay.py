"""Measured demand for the model: the same vehicles, entering when, where and as fast as they were measured."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from cosim.driver_discrepancy.network import Network
from cosim.driver_discrepancy.placed import Placed
from cosim.driver_discrepancy.settings import DEFAULT
from cosim.driver_discrepancy.tracks import TrackError
from sumo_nets import Town
from sumo_nets.sumo_files import write_xml
from sumo_nets.xml_guard import read_xml

_BY = DEFAULT.simulating
_FOREVER_S = 1_000_000
_MOTORISED = ("car", "van", "truck", "bus", "motorcycle")


@dataclass(frozen=True)
class Leaving:
    """Where a vehicle leaves the town: after so many edges, on this one, this far along it [m]."""

    edges: int
    edge: str
    along_m: float


@dataclass(frozen=True, eq=False)
class Replay:
    """A scenario that replays measured demand.

    Attributes:
        sumocfg: to start SUMO with.
        begin_s, seconds: simulation time of the first sample, and how long to simulate.
        sample_s: time between two samples of a vehicle.
        leaving: of vehicles that left before the end of the recording.
        vehicles: how many drive, and how many begin parked.
    """

    sumocfg: Path
    begin_s: float
    seconds: float
    sample_s: float
    leaving: Mapping[str, Leaving]
    vehicles: tuple[int, int]


def write_replay(placed: Placed, town: Town, folder: Path) -> Replay:
    """Write the scenario of the vehicles of some trajectories.

    Turning back where one could have gone on is behaviour, not demand: routes end before it, and whoever comes to the
    end of his route is sent on. So is leaving the kerb: who begins parked stays so.

    Raises:
        TrackError: nobody drives.
    """
    tracks = placed.tracks
    types = _types(placed)
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids) + 1))
    drivers, parkers, leaving = [], [], {}
    last_s = tracks.time_s.max()
    for who, name in enumerate(tracks.ids):
        rows = np.arange(first[who], first[who + 1])
        if placed.parked[rows[0]]:
            parkers += _parker(placed, name, types[who], int(rows[0]))
            continue
        streets = [row for row in rows.tolist() if placed.on[row] and tracks.lane[row][0] != ":"]
        if not streets:
            continue
        route, whole = _route(placed, streets)
        drivers.append((float(tracks.time_s[streets[0]]), _driver(placed, name, types[who], streets[0], route)))
        if whole and tracks.time_s[rows[-1]] < last_s - _BY.left_early_s and not placed.parked[rows[-1]]:
            leaving[name] = Leaving(len(route), route[-1], float(placed.along_m[streets[-1]]))
    if not drivers:
        raise TrackError("nobody drives on the town's lanes; measured trajectories must move")
    folder.mkdir(parents=True, exist_ok=True)
    routes = folder / "measured.rou.xml"
    drivers.sort(key=lambda one: one[0])
    write_xml(routes, "routes", [*_own_types(town), *parkers, *(line for _, lines in drivers for line in lines)])
    config, begin = folder / "measured.sumocfg", max(tracks.start_s, 0.0)
    options = {"net-file": str(town.net.resolve()), "route-files": routes.name, "begin": f"{begin:g}"}
    if town.additional:
        additional = town.runnable_additional(folder)
        options["additional-files"] = ",".join(str(path.resolve()) for path in additional)
    write_xml(config, "configuration", [f"    <{name} value={quoteattr(text)}/>" for name, text in options.items()])
    return Replay(
        sumocfg=config,
        begin_s=begin,
        seconds=tracks.seconds,
        sample_s=tracks.step_s,
        leaving=leaving,
        vehicles=(len(drivers), len(parkers) // 4),
    )


def route_files(town: Town) -> tuple[Path, ...]:
    """The route files that a town's configuration names and that exist."""
    root = read_xml(town.sumocfg, "configuration", "sumoConfiguration")
    keys = ("route-files", "routes", "r")
    names = [name.strip() for one in root.iter() if one.tag in keys for name in one.get("value", "").split(",")]
    return tuple(path for name in names if name and (path := town.sumocfg.parent / name).is_file())


def _own_types(town: Town) -> list[str]:
    """Vehicle types that stand among a town's routes."""
    found = []
    for path in route_files(town):
        root = read_xml(path)
        found += [f"    {ET.tostring(one, encoding='unicode').strip()}" for one in root.iter("vType")]
    return found


def _types(placed: Placed) -> list[str]:
    """A vType of the town for each vehicle: its own, or the middle one of its kind."""
    known = placed.network.types
    by_kind: dict[str, str] = {}
    for kind in {one.kind for one in known.values()}:
        same = sorted((one.length_m, name) for name, one in known.items() if one.kind == kind)
        by_kind[kind] = same[len(same) // 2][1]
    usual = by_kind.get("car", "DEFAULT_VEHTYPE")
    return [name if name in known else by_kind.get(name, usual) for name in placed.tracks.types]


def _route(placed: Placed, streets: list[int]) -> tuple[list[str], bool]:
    """Edges driven, up to where somebody turns back of his own will; and whether they are all."""
    network, lanes = placed.network, placed.network.lanes
    route: list[str] = []
    for row in streets:
        edge = lanes[placed.tracks.lane[row]].edge
        if route and route[-1] == edge:
            continue
        if route and _turns_back(network, route[-1], edge):
            return route, False
        way = network.way(route[-1], edge) if route else [edge]
        if not way:
            return route, False
        route += way[1:] if route else way
    return route, True


def _turns_back(network: Network, edge: str, onward: str) -> bool:
    """Whether somebody turned back who could have gone on."""
    return network.back.get(edge) == onward and bool({*network.onward.get(edge, ())} - {onward})


def _driver(placed: Placed, name: str, vtype: str, row: int, route: list[str]) -> list[str]:
    lane = placed.network.lanes[placed.tracks.lane[row]]
    along = min(float(placed.along_m[row]), lane.length_m - 0.1)
    speed = min(float(placed.tracks.speed_mps[row]), lane.limit_mps)
    depart = f'depart="{placed.tracks.time_s[row]:.2f}" departLane="{lane.index}" departPos="{along:.2f}"'
    checks = ' insertionChecks="none"' if placed.tracks.time_s[row] < placed.tracks.start_s + 0.5 else ""
    return [
        f'    <vehicle id={quoteattr(name)} type={quoteattr(vtype)} {depart} departSpeed="{speed:.2f}"{checks}>',
        f'        <route edges="{" ".join(route)}"/>',
        "    </vehicle>",
    ]


def _parker(placed: Placed, name: str, vtype: str, row: int) -> list[str]:
    """Lines (four) of a vehicle that begins parked: in the lot where it stands, or beside the lane."""
    network, tracks = placed.network, placed.tracks
    lane = network.lanes.get(tracks.lane[row]) or network.nearest(tracks.place[row])
    along = float(lane.project(tracks.place[row : row + 1])[0][0])
    lots = [
        (abs(end - along), lot)
        for lot, (where, start, end) in network.lots.items()
        if network.lanes.get(where, lane).edge == lane.edge and start - _BY.clear_m <= along <= end + _BY.clear_m
    ]
    where = f'parkingArea="{min(lots)[1]}"' if lots else f'lane="{lane.id}" endPos="{along:.2f}" parking="true"'
    return [
        f'    <vehicle id={quoteattr(name)} type={quoteattr(vtype)} depart="{max(tracks.start_s, 0):.2f}" '
        'departPos="stop">',
        f'        <route edges="{lane.edge}"/>',
        f'        <stop {where} duration="{_FOREVER_S}"/>',
        "    </vehicle>",
    ]
