"""Layouts that SUMO's netgenerate draws: grids, spiders' webs, random growth."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from sumo_nets.errors import TownError
from sumo_nets.plan import Plan, Street
from sumo_nets.recipe import Recipe, RingRoadLayout
from sumo_nets.tools import run_tool


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
