"""Traffic demand: moving and parked vehicles and pedestrians for the whole simulation."""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate
from typing import Any

import numpy as np

from sumo_nets.errors import TownError
from sumo_nets.parking import Lot
from sumo_nets.recipe import Demand
from sumo_nets.type_table import TypeTable

# Faster than anyone gets along on average, so that no route ends before the simulation does.
_DRIVING_PACE_MPS = 10.0
_CYCLING_PACE_MPS = 6.0
_WALKING_PACE_MPS = 1.6
_LEG_M = (120.0, 450.0)
_FIRST_S = 1.0  # parked vehicles take their places first


def make_demand(
    demand: Demand, network: Any, lots: tuple[Lot, ...], types: TypeTable, rng: np.random.Generator
) -> list[str]:
    """Return the lines of a route file.

    Drivers and cyclists wander through the town along lane connections, preferring streets that few have taken so far;
    pedestrians walk from one sidewalk to another; trams follow their tracks. Vehicle ids start with `veh`, `parked` or
    `tram`, persons' with `ped`.

    Args:
        demand: how many of each.
        network: the built network, as sumolib reads it.
        lots: places for the parked vehicles; no more are parked than fit.
        types: vehicle types to choose from.
        rng: source of every choice made here.

    Raises:
        TownError: trams are requested, but the network has no tracks on which they can drive on and on.
    """
    walking = _walking(demand, network, types, rng)
    parked, driving = _parked(demand, lots, types, rng), _driving(demand, network, types, rng)
    trams = _trams(demand, network, types, rng)
    return [*walking, *parked, *trams, *driving]  # in order of departure, as SUMO demands


def _parked(demand: Demand, lots: tuple[Lot, ...], types: TypeTable, rng: np.random.Generator) -> list[str]:
    chosen = sorted(rng.permutation(len(lots))[: demand.parked].tolist())
    type_names = types.parked(len(chosen), rng)
    slanted = [number for number, i in enumerate(chosen) if lots[i].is_slanted]
    for number, name in zip(slanted, types.parked(len(slanted), rng, kind="car"), strict=True):
        type_names[number] = name
    lines = []
    for number, lot in enumerate(lots[i] for i in chosen):
        lines += [
            f'    <vehicle id="parked{number}" type="{type_names[number]}" depart="0" departPos="stop">',
            f'        <route edges="{lot.edge}"/>',
            f'        <stop parkingArea="{lot.id}" duration="1000000"/>',
            "    </vehicle>",
        ]
    return lines


def _driving(demand: Demand, network: Any, types: TypeTable, rng: np.random.Generator) -> list[str]:
    streets = [edge for edge in network.getEdges() if edge.allows("passenger")]
    type_names = types.driving(demand.kinds, demand.driving, rng)
    everywhere = {edge.getID(): _ways_on(edge) for edge in streets}
    slow = _endless(everywhere, streets, "bicycle")
    taken = dict.fromkeys(everywhere, 0)
    width = {edge.getID(): float(np.sqrt(_capacity(edge))) for edge in streets}
    length_m = {edge.getID(): edge.getLength() for edge in streets}
    starts = [streets[i].getID() for i in rng.permutation(len(streets))]
    slow_starts = [name for name in starts if name in slow] or starts
    lines = []
    for number in range(demand.driving):
        cycles = types.is_bicycle(type_names[number])
        onward, begin = (slow, slow_starts) if cycles else (everywhere, starts)
        pace = _CYCLING_PACE_MPS if cycles else _DRIVING_PACE_MPS
        route = _wander(begin[number % len(begin)], onward, taken, demand.duration_s * pace, width, length_m, rng)
        depart = _FIRST_S + demand.fill_s * number / demand.driving
        lines += [
            f'    <vehicle id="veh{number}" type="{type_names[number]}" depart="{depart:.1f}" departLane="best" '
            'departPos="random_free" departSpeed="0">',
            f'        <route edges="{" ".join(route)}"/>',
            "    </vehicle>",
        ]
    return lines


def _trams(demand: Demand, network: Any, types: TypeTable, rng: np.random.Generator) -> list[str]:
    """Trams on random routes along the tracks; they never turn round."""
    if not demand.trams:
        return []
    tracks = [edge for edge in network.getEdges() if edge.allows("tram")]
    onward = _endless({edge.getID(): _ways_of_trams(edge) for edge in tracks}, tracks, "tram")
    if not onward:
        raise TownError("the town has no loop of tram tracks; request no trams, or give it a tram_line")
    type_names = types.trams(demand.trams, rng)
    taken = dict.fromkeys(onward, 0)
    length_m = {edge.getID(): edge.getLength() for edge in tracks}
    names = sorted(onward)
    starts = [names[i] for i in rng.permutation(len(names))]
    lines = []
    for number in range(demand.trams):
        start, total_m = starts[number % len(starts)], demand.duration_s * _DRIVING_PACE_MPS
        route = _wander(start, onward, taken, total_m, dict.fromkeys(onward, 1.0), length_m, rng)
        lines += [
            f'    <vehicle id="tram{number}" type="{type_names[number]}" depart="0" departLane="best" '
            'departPos="random_free" departSpeed="0">',
            f'        <route edges="{" ".join(route)}"/>',
            "    </vehicle>",
        ]
    return lines


def _ways_of_trams(edge: Any) -> list[str]:
    """Return the edges a tram can reach from this one without turning round."""
    ways = {
        target.getID()
        for target, links in edge.getOutgoing().items()
        if target.getToNode() is not edge.getFromNode()
        and any(link.getFromLane().allows("tram") and link.getToLane().allows("tram") for link in links)
    }
    return sorted(ways)


def _ways_on(edge: Any) -> list[str]:
    """Return the edges a car can reach from this one; back the way it came only from a dead end."""
    ways = {
        target.getID(): target
        for target, links in edge.getOutgoing().items()
        if any(link.getFromLane().allows("passenger") and link.getToLane().allows("passenger") for link in links)
    }
    onward = [name for name, way in sorted(ways.items()) if way.getToNode() is not edge.getFromNode()]
    return onward or sorted(ways)


def _endless(onward: dict[str, list[str]], streets: list[Any], vehicle_class: str) -> dict[str, list[str]]:
    """Return the ways on of a vehicle class: streets open to it from which it never runs out of such streets."""
    open_ = {edge.getID() for edge in streets if edge.allows(vehicle_class)}
    while True:
        ways = {name: [way for way in onward[name] if way in open_] for name in sorted(open_)}
        stuck = {name for name, subset in ways.items() if not subset}
        if not stuck:
            return ways
        open_ -= stuck


def _wander(
    start: str,
    onward: dict[str, list[str]],
    taken: dict[str, int],
    total_m: float,
    width: dict[str, float],
    length_m: dict[str, float],
    rng: np.random.Generator,
) -> list[str]:
    """Return the names of the edges of a random route of a given total length."""
    route, driven_m = [start], 0.0
    while driven_m < total_m and (choices := onward[route[-1]]):
        appeal = list(accumulate([width[way] / (5.0 + taken[way]) for way in choices]))
        way = choices[min(bisect_right(appeal, rng.random() * appeal[-1]), len(choices) - 1)]
        taken[way] += 1
        route.append(way)
        driven_m += length_m[way]
    return route


def _capacity(edge: Any) -> float:
    return edge.getSpeed() * sum(lane.allows("passenger") for lane in edge.getLanes())


def _walking(demand: Demand, network: Any, types: TypeTable, rng: np.random.Generator) -> list[str]:
    streets = [edge for edge in network.getEdges() if edge.allows("pedestrian")]
    if not streets or demand.walking == 0:
        return []
    type_names = types.walking(demand.walking, rng)
    middle = np.array([np.mean(edge.getShape(), axis=0)[:2] for edge in streets])
    lines = []
    for number in range(demand.walking):
        at, walked = int(rng.integers(len(streets))), 0.0
        position = rng.uniform(0, _sidewalk_length(streets[at]))
        lines.append(f'    <person id="ped{number}" type="{type_names[number]}" depart="0" departPos="{position:.1f}">')
        while walked < demand.duration_s * _WALKING_PACE_MPS:
            away = np.linalg.norm(middle - middle[at], axis=1)
            near = np.flatnonzero((away >= _LEG_M[0]) & (away <= _LEG_M[1]))
            near = near if near.size else np.flatnonzero(away > 0)
            to = int(rng.choice(near))
            lines.append(f'        <walk from="{streets[at].getID()}" to="{streets[to].getID()}"/>')
            at, walked = to, walked + float(away[to])
        lines.append("    </person>")
    return lines


def _sidewalk_length(edge: Any) -> float:
    return min(lane.getLength() for lane in edge.getLanes() if lane.allows("pedestrian"))
