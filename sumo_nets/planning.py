"""Street plans from layouts: main streets, bends, roundabouts, parking."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sumo_nets.corners import ease_corners
from sumo_nets.errors import TownError
from sumo_nets.plan import Plan, Street, road_of
from sumo_nets.recipe import Recipe, RingRoadLayout, StreetRules
from sumo_nets.ring_road import ring_road
from sumo_nets.roundabouts import add_roundabouts
from sumo_nets.tools import run_tool

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_SHAPE_STEP_M = 10.0
_SHORTEST_PARKING_STREET_M = 55.0
_PARKING_RADIUS_M = 10.0  # no parking in tighter bends
_SLANTED_RADIUS_M = 120.0  # no slanted parking in tighter bends


def make_plan(recipe: Recipe, rng: np.random.Generator, workshop: Path) -> Plan:
    """Lay out a town, choose its main streets, drop some others, bend the rest and give them parking.

    Args:
        recipe: the town's recipe.
        rng: source of every choice made here.
        workshop: folder for netgenerate's files.

    Raises:
        TownError: netgenerate refused the layout, or the tram line needs a street that does not exist.
    """
    if isinstance(recipe.layout, RingRoadLayout):
        plan = ring_road(recipe.layout, recipe.streets)
    else:
        plan = lay_out(recipe, workshop)
        plan = _mark_main(plan, recipe.streets, rng)
    plan = _drop_streets(plan, recipe.streets, rng)
    plan = _bend(plan, recipe.streets, rng)
    plan = add_roundabouts(plan, recipe.streets)
    plan = ease_corners(plan)
    plan = _widen(_add_parking(plan, recipe.streets, rng), recipe.streets)
    return _lay_tracks(plan, recipe)


def _graph(plan: Plan, streets: list[Street] | tuple[Street, ...]) -> csr_matrix:
    from scipy.sparse import csr_matrix

    n = len(plan.names)
    a, b = np.array([(s.start, s.end) for s in streets]).T
    length = np.linalg.norm(plan.positions[a] - plan.positions[b], axis=1)
    return csr_matrix((length, (a, b)), shape=(n, n))


def _mark_main(plan: Plan, rules: StreetRules, rng: np.random.Generator) -> Plan:
    """Make the shortest ways across the town, in evenly spread directions, its main streets."""
    from scipy.sparse.csgraph import dijkstra

    main: set[tuple[int, int]] = set()
    graph = _graph(plan, plan.streets)
    first = rng.uniform(-0.2, 0.2)
    for angle in first + np.pi * np.arange(rules.main_routes) / max(rules.main_routes, 1):
        along = plan.positions @ np.array([np.cos(angle), np.sin(angle)])
        aside = 0.7 * np.abs(plan.positions @ np.array([-np.sin(angle), np.cos(angle)]))
        start, node = int(np.argmin(along + aside)), int(np.argmax(along - aside))
        before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)[1]
        while node != start:
            main.add((min(node, int(before[node])), max(node, int(before[node]))))
            node = int(before[node])
    return replace(plan, streets=tuple(replace(s, main=(s.start, s.end) in main) for s in plan.streets))


def _drop_streets(plan: Plan, rules: StreetRules, rng: np.random.Generator) -> Plan:
    """Leave out local streets without disconnecting the town or making dead ends."""
    from scipy.sparse.csgraph import connected_components

    kept = list(plan.streets)
    arms = plan.arms()
    to_drop = round(rules.dropped * len(kept))
    for index in rng.permutation(len(kept)):
        street = plan.streets[index]
        rest = [s for s in kept if s is not street]
        if to_drop == 0:
            break
        if street.main or street.road is not None or min(arms[street.start], arms[street.end]) < 3:
            continue
        if connected_components(_graph(plan, rest), directed=False, return_labels=False) > 1:
            continue
        kept = rest
        arms[[street.start, street.end]] -= 1
        to_drop -= 1
    return replace(plan, streets=tuple(kept))


def _bend(plan: Plan, rules: StreetRules, rng: np.random.Generator) -> Plan:
    """Bow the straight local streets sideways and give every straight street closely spaced shape points."""
    streets = []
    for street in plan.streets:
        if street.road is not None or len(street.shape) > 2:
            streets.append(street)
            continue
        a, b = street.shape
        length = float(np.linalg.norm(b - a))
        along = np.linspace(0, 1, max(2, int(np.ceil(length / _SHAPE_STEP_M)) + 1))
        bow = rng.uniform(-rules.bend_m, rules.bend_m) * min(1.0, length / 100)
        left = np.array([a[1] - b[1], b[0] - a[0]]) / length
        aside = (0 if street.main else bow) * np.sin(np.pi * along) ** 2
        shape = a + along[:, None] * (b - a) + aside[:, None] * left
        streets.append(replace(street, shape=shape))
    return replace(plan, streets=tuple(streets))


def _add_parking(plan: Plan, rules: StreetRules, rng: np.random.Generator) -> Plan:
    streets = []
    for street in plan.streets:
        length = np.linalg.norm(np.diff(street.shape, axis=0), axis=1).sum()
        chosen = rng.random(2) < (rules.main_parking_share if street.main else rules.parking_share)
        if street.road is not None:
            chosen = street.parking
        elif length < _SHORTEST_PARKING_STREET_M or _tightest_radius_m(street.shape) < _PARKING_RADIUS_M:
            chosen = (False, False)
        parking = bool(chosen[0]), bool(chosen[1])
        slanted = (False, False)
        can_slant = not street.main and street.road is None and _tightest_radius_m(street.shape) > _SLANTED_RADIUS_M
        if rules.slanted_share > 0 and can_slant:
            wide = rng.random(2) < rules.slanted_share
            slanted = parking[0] and bool(wide[0]), parking[1] and bool(wide[1])
        streets.append(replace(street, parking=parking, slanted=slanted))
    return replace(plan, streets=tuple(streets))


def _widen(plan: Plan, rules: StreetRules) -> Plan:
    """Give the longest main streets two lanes per direction, for overtaking and turning."""
    length = [np.linalg.norm(np.diff(street.shape, axis=0), axis=1).sum() for street in plan.streets]
    narrow = [i for i, street in enumerate(plan.streets) if street.main and road_of(street, rules).lanes == 1]
    wide = set(sorted(narrow, key=lambda i: (-length[i], i))[: rules.widened])
    streets = [
        replace(street, road=replace(road_of(street, rules), lanes=2)) if i in wide else street
        for i, street in enumerate(plan.streets)
    ]
    return replace(plan, streets=tuple(streets))


def _lay_tracks(plan: Plan, recipe: Recipe) -> Plan:
    """Lay the tracks of the tram line, in driving direction."""
    line = recipe.tram_line
    tracks = [f"{start}_{end}" for start, end in zip(line, (*line[1:], *line[:1]), strict=True)]
    edges = {plan.edge(street, forward) for street in plan.streets for forward in (True, False)}
    missing = [edge for edge in tracks if edge not in edges]
    if missing:
        raise TownError(
            f"town {recipe.name!r}: tram_line needs the street {missing[0]!r}, which the layout does not have; choose "
            "other junctions"
        )
    return replace(plan, tracks=frozenset(tracks))


def _tightest_radius_m(shape: np.ndarray) -> float:
    pieces = np.diff(shape, axis=0)
    length = np.linalg.norm(pieces, axis=1)
    heading = np.unwrap(np.arctan2(pieces[:, 1], pieces[:, 0]))
    turned = np.abs(np.diff(heading)) / ((length[:-1] + length[1:]) / 2)
    return 1 / max(float(turned.max(initial=0.0)), 1e-9)


def lay_out(recipe: Recipe, workshop: Path) -> Plan:
    """Return the junctions of a recipe's layout, joined by straight two-way streets.

    Args:
        recipe: its layout and seed.
        workshop: folder for netgenerate's files.

    Raises:
        TownError: netgenerate refused the layout or made no streets of it.
    """
    assert not isinstance(recipe.layout, RingRoadLayout)
    arguments = [*recipe.layout.arguments(), "--seed", str(recipe.seed)]
    outputs = ["--plain-output-prefix", "layout", "--output-file", "layout.net.xml"]
    run_tool("netgenerate", *arguments, *outputs, cwd=workshop)
    nodes = ET.parse(workshop / "layout.nod.xml").getroot().findall("node")
    names = tuple(node.get("id", "") for node in nodes)
    if len(nodes) < 2:
        raise TownError(f"town {recipe.name!r}: netgenerate made no streets of its layout; choose another")
    number = {name: i for i, name in enumerate(names)}
    positions = np.array([[float(node.get(axis, "nan")) for axis in "xy"] for node in nodes])
    positions -= (positions.min(axis=0) + positions.max(axis=0)) / 2
    edges = ET.parse(workshop / "layout.edg.xml").getroot().findall("edge")
    pairs = {frozenset((number[e.get("from", "")], number[e.get("to", "")])) for e in edges}
    ends = sorted(tuple(sorted(pair)) for pair in pairs if len(pair) == 2)
    return Plan(names, positions, tuple(Street(a, b, positions[[a, b]]) for a, b in ends))
