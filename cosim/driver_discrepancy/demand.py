"""Measured demand for the model: the same vehicles enter when, where and as fast as they were measured."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from cosim.driver_discrepancy.network import Network, SignalProgram
from cosim.driver_discrepancy.placed import Placed, kind_of
from cosim.driver_discrepancy.settings import DEFAULT
from cosim.driver_discrepancy.signals import Phases
from cosim.driver_discrepancy.tracks import TrackError
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.behaviour.habits import Habits, draw_habits
from sumo_nets import Town
from sumo_nets.sumo_files import write_xml
from sumo_nets.xml_guard import read_xml

_BY = DEFAULT.simulating
_FOREVER_S = 1_000_000
_SUMO_CLOCK_S = 1e6  # later times are not those of a SUMO simulation
_TAIL_EDGES, _WAYS_ON = 8, 12
_BORDER_M = 15.0  # before the farthest place seen on an edge, where a vehicle leaves what is seen
_NOT_MOTORISED = ("bicycle", "scooter", "pedestrian")  # keep the parameters of their vehicle types
_OPTIONS = (
    *("lanechange.duration", "step-method.ballistic", "default.action-step-length", "default.speeddev"),
    *("ignore-junction-blocker", "collision.action", "collision.mingap-factor", "default.emergencydecel"),
)
"""Options of a user's `.sumocfg` that decide how vehicles move."""
_NORMAL = re.compile(r"normc?\(([^)]*)\)")


@dataclass(frozen=True)
class Trip:
    """One vehicle.

    Attributes:
        name: id.
        base: vType that it has, and SUMO's attributes of that.
        depart_s: by the clock of the simulation.
        lane, along_m, speed_mps: initial position and speed; the lane's index.
        route: edges as measured.
        onward: ways on from the last edge, of which each seed takes one: the true one is not known. Empty for a
            vehicle that leaves at the end of its route.
        limit_mps: mean limit of the route, for excesses in km/h.
        lane_limit_mps: limit of its first lane.
        leaves_m: position on the last edge at which it was last measured; None if it is present at the end.
        leaves_at: the same in world axes, x, y [m] and heading [rad].
        checked: whether SUMO may delay its insertion until it is safe.
        stop: SUMO's attributes of the place where it is parked; empty for a driving vehicle.
        turns: edges of the route at whose end it turns back.
    """

    name: str
    base: tuple[str, tuple[tuple[str, str], ...]]
    depart_s: float
    lane: int
    along_m: float
    speed_mps: float
    route: tuple[str, ...]
    onward: tuple[tuple[str, ...], ...]
    limit_mps: float
    lane_limit_mps: float
    leaves_m: float | None = None
    leaves_at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    checked: bool = True
    stop: str = ""
    turns: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class MeasuredDemand:
    """Inputs of a simulation of the measured demand.

    Attributes:
        net, additional: files.
        trips: of all vehicles, those that are parked at the start first.
        begin_s, seconds: by the simulation's clock, and how long to simulate.
        clock_s: the simulation's clock less the recording's [s].
        sample_s: time between two samples of a vehicle.
        options: SUMO's, that decide how vehicles move.
        lateral_m: lateral resolution of the sublane model; 0 without it.
        programs: traffic lights whose offsets differ from the network's, by the simulation's clock.
        vehicles: how many drive, and how many are parked at the start.
    """

    net: Path
    additional: tuple[Path, ...]
    trips: tuple[Trip, ...]
    begin_s: float
    seconds: float
    clock_s: float
    sample_s: float
    options: Mapping[str, str]
    lateral_m: float
    programs: Mapping[str, SignalProgram]
    vehicles: tuple[int, int]

    @property
    def planned(self) -> frozenset[tuple[str, str]]:
        """Vehicle and edge after which its route goes on with the edge of the other direction, or may do so."""
        return frozenset((trip.name, edge) for trip in self.trips for edge in trip.turns)


def read_demand(placed: Placed, town: Town, phases: Phases, lateral_m: float, folder: Path) -> MeasuredDemand:
    """The demand of some trajectories.

    Routes are those measured, U-turns at junctions included; the channel `u_turns` counts those of simulations only
    that were not measured. Pull-outs are behaviour, not demand: a vehicle that is parked at the start stays there.

    Raises:
        TrackError: no vehicle drives.
    """
    tracks, network = placed.tracks, placed.network
    start_s = tracks.start_s
    clock_s = 0.0 if 0 <= start_s < _SUMO_CLOCK_S else -float(np.floor(start_s))
    bases = _bases(placed)
    types = kind_of(tracks, network)
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids) + 1))
    is_street = placed.of_lane(lambda _, lane: float(not lane.inside)) > 0
    seen_to = _seen_to(placed)
    drivers, parkers = [], []
    last_s = tracks.time_s.max()
    for who, name in enumerate(tracks.ids):
        rows = np.arange(first[who], first[who + 1])
        if placed.parked[rows[0]]:
            parkers.append(_parker(placed, name, bases[who], int(rows[0]), clock_s))
            continue
        streets = rows[is_street[rows] & ~placed.parked[rows]]
        if not len(streets) or types[who] == "pedestrian":
            continue
        route, whole = _route(placed, streets)
        stays = not whole or tracks.time_s[rows[-1]] > last_s - _BY.left_early_s or bool(placed.parked[rows[-1]])
        begin = int(streets[0])
        lane = network.lanes[placed.lanes[placed.code[begin]]]
        end = int(streets[-1])
        leaves_m = None if stays else float(placed.along_m[end])
        last_lane = _last_lane(placed, rows)
        goes_on = leaves_m is None or leaves_m > seen_to.get(route[-1], np.inf) - _BORDER_M
        drivers.append(
            Trip(
                name=name,
                base=bases[who],
                depart_s=float(tracks.time_s[begin]) + clock_s,
                lane=lane.index,
                along_m=min(float(placed.along_m[begin]), lane.length_m - 0.1),
                speed_mps=float(tracks.speed_mps[begin]),
                route=tuple(route),
                onward=_ways_on(network, route[-1], last_lane, name) if goes_on else (),
                limit_mps=float(np.mean([network.lanes_of(edge)[0].limit_mps for edge in route])),
                lane_limit_mps=lane.limit_mps,
                leaves_m=leaves_m,
                leaves_at=(*tracks.place[end].tolist(), float(tracks.heading_rad[end])),
                checked=bool(tracks.time_s[begin] > start_s + 0.5),
                turns=tuple(a for a, b in pairwise(route) if network.back.get(a) == b),
            )
        )
    if not drivers:
        raise TrackError(_refusal(placed))
    drivers.sort(key=lambda trip: (trip.depart_s, trip.name))
    scenario = {} if town.scenario is None else town.scenario.options
    return MeasuredDemand(
        net=town.net.resolve(),
        additional=tuple(path.resolve() for path in town.runnable_additional(folder)) if town.additional else (),
        trips=(*parkers, *drivers),
        begin_s=max(start_s + clock_s, 0.0),
        seconds=tracks.seconds,
        clock_s=clock_s,
        sample_s=tracks.step_s,
        options={name: value for name, value in scenario.items() if name in _OPTIONS},
        lateral_m=lateral_m,
        programs=_moved_programs(network, phases, clock_s),
        vehicles=(len(drivers), len(parkers)),
    )


def write_demand(
    demand: MeasuredDemand, behaviour: BehaviourConfig, seed: int, step_s: float, folder: Path
) -> list[str]:
    """Write the demand with the drivers of a behaviour; returns SUMO's options that name the files.

    Every vehicle has a vType of its own: that of its recording with the parameters that the behaviour sets. Equal
    seeds give each driver the same draws whatever the behaviour.
    """
    lines = []
    for trip in demand.trips:
        habits = draw_habits(behaviour, seed, trip.name)
        factor, attributes = driver_attributes(trip, behaviour, habits, seed, step_s)
        if demand.lateral_m > 0 and habits.lane_offset_m:
            attributes["latAlignment"] = f"{habits.lane_offset_m:.3f}"
        words = " ".join(f"{key}={quoteattr(value)}" for key, value in attributes.items())
        lines.append(f"    <vType id={quoteattr(f'{trip.base[0]}@{trip.name}')} {words}/>")
        streets = behaviour.street_speed
        slower = streets.factor if streets is not None and trip.route[0] in streets.edges else 1.0
        fastest = trip.lane_limit_mps * min(slower, 1.0) * factor
        fastest = min(fastest, float(attributes.get("desiredMaxSpeed", np.inf)) * factor)
        lines += _vehicle(
            trip,
            trip.onward[seed % len(trip.onward)] if trip.onward else (),
            min(fastest, float(attributes.get("maxSpeed", np.inf))),
        )
    write_xml(folder / "demand.rou.xml", "routes", lines)
    additional = list(demand.additional)
    if demand.programs:
        write_xml(folder / "lights.add.xml", "additional", _logics(demand.programs))
        additional.append(folder / "lights.add.xml")
    files = ["-n", str(demand.net), "-r", str(folder / "demand.rou.xml")]
    return [*files, "-a", ",".join(str(path) for path in additional)] if additional else files


def driver_attributes(
    trip: Trip, behaviour: BehaviourConfig, habits: Habits, seed: int, step_s: float
) -> tuple[float, dict[str, str]]:
    """Speed factor and SUMO's attributes of a driver's vType."""
    attributes = dict(trip.base[1])
    if attributes.get("vClass") in _NOT_MOTORISED:
        factor = _own_factor(attributes, seed, trip.name)
        return factor, attributes | {"speedFactor": f"{factor:.4f}", "speedDev": "0"}
    own = _own_factor(attributes, seed, trip.name) if behaviour.speeding_share is None else 1.0
    factor = max(habits.speed_factor(trip.limit_mps, own), 0.1)
    attributes |= {"speedFactor": f"{factor:.4f}", "speedDev": "0"}
    values = {
        "minGap": habits.gap_m,
        "tau": habits.headway_s,
        "sigma": habits.imperfection,
        "accel": habits.accel_mps2,
        "decel": habits.decel_mps2,
        "startupDelay": habits.startup_delay_s,
        "jmTimegapMinor": habits.time_gap_s,
    }
    attributes |= {key: f"{value:.4f}" for key, value in values.items() if value is not None}
    if habits.decel_mps2 is not None:
        strongest = max(float(attributes.get("emergencyDecel", 9.0)), habits.decel_mps2)
        attributes["emergencyDecel"] = f"{strongest:.3f}"
        attributes.pop("apparentDecel", None)
    if habits.reaction_s is not None:
        attributes["actionStepLength"] = f"{max(1, round(habits.reaction_s / step_s)) * step_s:.3f}"
    return factor, attributes


def own_speed_factor(attributes: Mapping[str, str]) -> tuple[float, float]:
    """Mean and standard deviation of a vType's speed factor, with SUMO's defaults."""
    text = attributes.get("speedFactor", "")
    found = _NORMAL.match(text)
    if found:
        numbers = [float(word) for word in found.group(1).split(",")]
        return numbers[0], numbers[1]
    usual = 0.1 if attributes.get("vClass", "passenger") in ("passenger", "private", "taxi") else 0.05
    return float(text or 1.0), float(attributes.get("speedDev", usual))


def route_files(town: Town) -> tuple[Path, ...]:
    """The route files that a town's configuration names and that exist."""
    root = read_xml(town.sumocfg, "configuration", "sumoConfiguration")
    keys = ("route-files", "routes", "r")
    names = [name.strip() for one in root.iter() if one.tag in keys for name in one.get("value", "").split(",")]
    return tuple(path for name in names if name and (path := town.sumocfg.parent / name).is_file())


def _own_factor(attributes: Mapping[str, str], seed: int, name: str) -> float:
    mean, deviation = own_speed_factor(attributes)
    luck = np.random.default_rng([seed, zlib.crc32(name.encode()), 6]).standard_normal()
    return float(np.clip(mean + deviation * luck, 0.2, 2.0))


def _refusal(placed: Placed) -> str:
    if placed.parked.all():
        return "all vehicles are parked throughout; measured trajectories must move"
    return "no vehicle drives on the town's lanes; give trajectories of road vehicles on this network"


def _bases(placed: Placed) -> list[tuple[str, tuple[tuple[str, str], ...]]]:
    """vType and its attributes of each vehicle: its own, or the middle one of its kind."""
    known = placed.network.types
    by_kind: dict[str, str] = {}
    for kind in {one.kind for one in known.values()}:
        same = sorted((one.length_m, name) for name, one in known.items() if one.kind == kind)
        by_kind[kind] = same[len(same) // 2][1]
    found = []
    for word in placed.tracks.types:
        name = word if word in known else by_kind.get(word, by_kind.get("car", ""))
        plain = (("vClass", "passenger"),)
        found.append((name or "car", tuple(known[name].attributes.items()) if name in known else plain))
    return found


def _route(placed: Placed, streets: np.ndarray) -> tuple[list[str], bool]:
    """Edges driven, up to where no way of the network leads on; and whether they are all."""
    network, lanes = placed.network, placed.network.lanes
    codes = placed.code[streets]
    changes = np.concatenate([[True], np.diff(codes) != 0])
    route: list[str] = []
    for code in codes[changes].tolist():
        edge = lanes[placed.lanes[code]].edge
        if route and route[-1] == edge:
            continue
        way = network.way(route[-1], edge) if route else [edge]
        if not way:
            return route, False
        route += way[1:] if route else way
    return route, True


def _last_lane(placed: Placed, rows: np.ndarray) -> str:
    """The lane of cars on which a vehicle was seen last."""
    on = rows[placed.on[rows] & ~placed.parked[rows]]
    return placed.lanes[placed.code[on[-1]]]


def _seen_to(placed: Placed) -> dict[str, float]:
    """Edge → farthest position on it at which anybody was seen [m]: beyond it may lie the border of what is seen."""
    found: dict[str, float] = {}
    lanes = placed.network.lanes
    for code, name in enumerate(placed.lanes):
        if name in lanes and not lanes[name].inside:
            edge, rows = lanes[name].edge, placed.code == code
            found[edge] = max(found.get(edge, 0.0), float(placed.along_m[rows].max()))
    return found


def _ways_on(network: Network, edge: str, last_lane: str, name: str) -> tuple[tuple[str, ...], ...]:
    """Continuations of a route for a vehicle that does not end there, so that none vanishes early.

    The first edge is one to which the vehicle's last lane leads; the others are drawn.
    """
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    lanes, links = network.lanes, network.links
    leads = [lanes[link.target].edge for link in links.get(last_lane, ()) if lanes[link.target].edge != edge]
    inside = [link.target for subset in links.values() for link in subset if link.via == last_lane]
    first = [lanes[target].edge for target in inside] or leads
    ways = []
    for _ in range(_WAYS_ON):
        at, way, options = edge, [], first
        for _ in range(_TAIL_EDGES):
            onward = list(network.onward.get(at, ()))
            options = [one for one in options if one in onward] or onward
            options = [one for one in options if one != network.back.get(at)] or options
            if not options:
                break
            at = options[int(rng.integers(len(options)))]
            way.append(at)
            options = []
        ways.append(tuple(way))
    return tuple(ways) if ways[0] else ()


def _vehicle(trip: Trip, onward: tuple[str, ...], fastest_mps: float) -> list[str]:
    head = f"    <vehicle id={quoteattr(trip.name)} type={quoteattr(f'{trip.base[0]}@{trip.name}')}"
    route = f'        <route edges="{" ".join((*trip.route, *onward))}"/>'
    if trip.stop:
        head += f' depart="{trip.depart_s:.2f}" departPos="stop">'
        return [head, route, f'        <stop {trip.stop} duration="{_FOREVER_S}"/>', "    </vehicle>"]
    speed = min(trip.speed_mps, 0.99 * fastest_mps)
    head += f' depart="{max(trip.depart_s, 0):.2f}" departLane="{trip.lane}" departPos="{trip.along_m:.2f}"'
    checks = "collision leaderGap followerGap junction" if trip.checked else "none"
    head += f' departSpeed="{speed:.2f}" insertionChecks="{checks}"'
    if trip.leaves_m is not None and not onward:
        head += f' arrivalPos="{trip.leaves_m:.2f}"'
    return [head + ">", route, "    </vehicle>"]


def _parker(placed: Placed, name: str, base: tuple[str, tuple[tuple[str, str], ...]], row: int, clock_s: float) -> Trip:
    """A vehicle that is parked at the start: in its lot, or at the side of the lane."""
    network, tracks = placed.network, placed.tracks
    lane = network.lanes.get(placed.lanes[placed.code[row]]) or network.nearest(tracks.place[row])
    along = float(lane.project(tracks.place[row : row + 1])[0][0])
    lots = [
        (abs(end - along), lot)
        for lot, (where, start, end) in network.lots.items()
        if network.lanes.get(where, lane).edge == lane.edge and start - _BY.clear_m <= along <= end + _BY.clear_m
    ]
    where = f'parkingArea="{min(lots)[1]}"' if lots else f'lane="{lane.id}" endPos="{along:.2f}" parking="true"'
    depart = max(tracks.start_s + clock_s, 0.0)
    return Trip(
        name, base, depart, lane.index, along, 0.0, (lane.edge,), (), lane.limit_mps, lane.limit_mps, stop=where
    )


def _moved_programs(network: Network, phases: Phases, clock_s: float) -> dict[str, SignalProgram]:
    found = {}
    for name, program in phases.programs.items():
        offset = (program.offset_s + clock_s) % program.cycle_s
        if abs(offset - network.programs[name].offset_s % program.cycle_s) > 0.5:
            found[name] = SignalProgram(offset, program.durations_s, program.states)
    return found


def _logics(programs: Mapping[str, SignalProgram]) -> list[str]:
    lines = []
    for name, program in programs.items():
        head = f'type="static" programID="recording" offset="{program.offset_s:.1f}"'
        lines.append(f"    <tlLogic id={quoteattr(name)} {head}>")
        for duration, state in zip(program.durations_s, program.states, strict=True):
            lines.append(f'        <phase duration="{duration:g}" state="{state}"/>')
        lines.append("    </tlLogic>")
    return lines
