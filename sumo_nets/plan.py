"""The street plan: which junctions and streets a town has, before SUMO gives them lanes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from sumo_nets.errors import TownError
from sumo_nets.recipe import Recipe, StreetRules
from sumo_nets.tools import run_tool

_SHAPE_STEP_M = 10.0
_SHORTEST_PARKING_STREET_M = 55.0


@dataclass(frozen=True)
class Street:
    """A two-way street between two junctions.

    Attributes:
        start, end: junction numbers.
        shape: (k, 2) its middle line from start to end, world metres.
        main: a main street, with more lanes and a higher limit.
        parking: parking strips on the right, driving from start to end and from end to start.
    """

    start: int
    end: int
    shape: np.ndarray
    main: bool = False
    parking: tuple[bool, bool] = (False, False)


@dataclass(frozen=True)
class Plan:
    """Junctions and streets.

    Attributes:
        names: junction ids.
        positions: (n, 2) junctions, world metres, centred on the origin.
        streets: what joins them.
    """

    names: tuple[str, ...]
    positions: np.ndarray
    streets: tuple[Street, ...]

    def arms(self, main_only: bool = False) -> np.ndarray:
        """Return how many (main) streets meet at each junction, (n,) int."""
        ends = [node for s in self.streets if s.main or not main_only for node in (s.start, s.end)]
        return np.bincount(np.array(ends, dtype=np.int64), minlength=len(self.names))


def make_plan(recipe: Recipe, rng: np.random.Generator, workshop: Path) -> Plan:
    """Lay out a town, choose its main streets, drop some others, bend the rest and give them parking.

    Args:
        recipe: the town's recipe.
        rng: source of every choice made here.
        workshop: folder for netgenerate's files.

    Raises:
        TownError: netgenerate refused the layout.
    """
    plan = _layout(recipe, workshop)
    plan = _mark_main(plan, recipe.streets, rng)
    plan = _drop_streets(plan, recipe.streets, rng)
    plan = _bend(plan, recipe.streets, rng)
    return _add_parking(plan, recipe.streets, rng)


def _layout(recipe: Recipe, workshop: Path) -> Plan:
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


def _graph(plan: Plan, streets: list[Street] | tuple[Street, ...]) -> csr_matrix:
    n = len(plan.names)
    a, b = np.array([(s.start, s.end) for s in streets]).T
    length = np.linalg.norm(plan.positions[a] - plan.positions[b], axis=1)
    return csr_matrix((length, (a, b)), shape=(n, n))


def _mark_main(plan: Plan, rules: StreetRules, rng: np.random.Generator) -> Plan:
    """Make the shortest ways across the town, in evenly spread directions, its main streets."""
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
    """Leave out local streets, but never cut the town in two nor make a dead end."""
    kept = list(plan.streets)
    arms = plan.arms()
    to_drop = round(rules.dropped * len(kept))
    for index in rng.permutation(len(kept)):
        street = plan.streets[index]
        rest = [s for s in kept if s is not street]
        if to_drop == 0:
            break
        if street.main or min(arms[street.start], arms[street.end]) < 3:
            continue
        if connected_components(_graph(plan, rest), directed=False, return_labels=False) > 1:
            continue
        kept = rest
        arms[[street.start, street.end]] -= 1
        to_drop -= 1
    return replace(plan, streets=tuple(kept))


def _bend(plan: Plan, rules: StreetRules, rng: np.random.Generator) -> Plan:
    """Bow the local streets sideways and give every street closely spaced shape points."""
    streets = []
    for street in plan.streets:
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
        chosen = rng.random(2) < rules.parking_share
        if street.main or length < _SHORTEST_PARKING_STREET_M:
            chosen = (False, False)
        streets.append(replace(street, parking=(bool(chosen[0]), bool(chosen[1]))))
    return replace(plan, streets=tuple(streets))
