"""SUMO networks from street plans, with heights of the ground."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sumo_nets.parking import slanted_strip_m
from sumo_nets.plan import Plan, Street, road_of
from sumo_nets.polyline import beside, densify
from sumo_nets.recipe import Recipe, StreetRules
from sumo_nets.relief import TerrainHeights
from sumo_nets.tools import run_tool, strip_comments

_LONGEST_PIECE_M = 12.0
_DRIVERS = "passenger delivery truck bus motorcycle bicycle emergency taxi"


def build_network(recipe: Recipe, plan: Plan, ground: TerrainHeights, rng: np.random.Generator, net: Path) -> None:
    """Write the plain XML files next to `net` and make the network with netconvert.

    From the kerb inwards an edge has a sidewalk, a parking strip where the plan wants one (a lane that is closed to
    all, so that nothing drives there and the sidewalk keeps clear of it), and the driving lanes.

    Raises:
        TownError: netconvert refused the files.
    """
    folder = net.parent
    (folder / "town.nod.xml").write_text(_nodes(recipe, plan, ground, rng), encoding="utf-8")
    (folder / "town.edg.xml").write_text(_edges(recipe, plan, ground), encoding="utf-8")
    (folder / "town.con.xml").write_text(_connections(plan), encoding="utf-8")
    run_tool("netconvert", *_options(plan), "-o", net.name, cwd=folder)
    strip_comments(net)
    drape(net, ground)


def drape(net: Path, ground: TerrainHeights) -> None:
    """Put every shape point of a network exactly on the ground, and points where there are few.

    netconvert carries the height of a street's middle line sideways to its lanes; where streets meet on a slope, their
    corners would then end at different heights.
    """

    def shape(match: re.Match[str]) -> str:
        xy = np.array([[float(v) for v in point.split(",")[:2]] for point in match[1].split()])
        xy = densify(xy, _LONGEST_PIECE_M)
        return f' shape="{_points(xy, ground.height(xy))}"'

    def junction(match: re.Match[str]) -> str:
        height = float(ground.height(np.array([float(match[2]), float(match[3])])))
        return f'{match[1]} x="{match[2]}" y="{match[3]}" z="{height:.3f}"'

    text = net.read_text(encoding="utf-8")
    text = re.sub(r' shape="([^"]*)"', shape, text)
    text = re.sub(r'(<junction [^>]*?) x="([^"]*)" y="([^"]*)"(?: z="[^"]*")?', junction, text)
    net.write_text(text, encoding="utf-8", newline="\n")


def _options(plan: Plan) -> Sequence[str]:
    files = "--node-files town.nod.xml --edge-files town.edg.xml --offset.disable-normalization"
    walking = "--walkingareas --crossings.guess --crossings.guess.speed-threshold 17 --default.crossing-width 3"
    junctions = "--junctions.corner-detail 5 --junctions.internal-link-detail 8 --default.junctions.radius 4"
    signals = "--tls.default-type static --tls.cycle.time 60"
    links = "--connection-files town.con.xml" if plan.links or plan.closed else ""
    return f"{files} {links} {walking} {junctions} {signals} --precision 3".split()


def _connections(plan: Plan) -> str:
    lines = [
        f'    <connection from="{link.edge}" to="{link.to_edge}" fromLane="{link.lane}" toLane="{link.to_lane}"/>'
        for link in plan.links
    ]
    lines += [f'    <delete from="{edge}" to="{to_edge}"/>' for edge, to_edge in plan.closed]
    return "\n".join(["<connections>", *lines, "</connections>", ""])


def _nodes(recipe: Recipe, plan: Plan, ground: TerrainHeights, rng: np.random.Generator) -> str:
    lines = ["<nodes>"]
    arms, main_arms = plan.arms(), plan.arms(main_only=True)
    for i, (name, (x, y)) in enumerate(zip(plan.names, plan.positions, strict=True)):
        if arms[i] == 0:
            continue
        kind = _control(int(arms[i]), int(main_arms[i]), recipe.streets, rng)
        kind = plan.controls.get(name, kind)
        z = float(ground.height(np.array([x, y])))
        wide = f' radius="{plan.radii[name]:.1f}"' if name in plan.radii else ""
        lines.append(f'    <node id="{name}" x="{x:.2f}" y="{y:.2f}" z="{z:.3f}" type="{kind}"{wide}/>')
    return "\n".join([*lines, "</nodes>", ""])


def _control(arms: int, main_arms: int, rules: StreetRules, rng: np.random.Generator) -> str:
    """Choose a junction's control from how many (main) streets meet there."""
    signal, stop = rng.random(2)
    if main_arms >= 3 or (main_arms > 0 and arms >= 4 and signal < rules.signal_share):
        return "traffic_light"
    if arms > max(main_arms, 2) and main_arms > 0 and stop < rules.stop_share:
        return "priority_stop"
    return "priority" if main_arms > 0 or arms < 3 else "right_before_left"


def _edges(recipe: Recipe, plan: Plan, ground: TerrainHeights) -> str:
    lines = ["<edges>"]
    for street in plan.streets:
        lines += _edge(recipe.streets, plan, ground, street, forward=True)
        if not road_of(street, recipe.streets).oneway:
            lines += _edge(recipe.streets, plan, ground, street, forward=False)
    return "\n".join([*lines, "</edges>", ""])


def _edge(rules: StreetRules, plan: Plan, ground: TerrainHeights, street: Street, forward: bool) -> list[str]:
    start, end = (street.start, street.end) if forward else (street.end, street.start)
    road = road_of(street, rules)
    xy = street.shape if forward else street.shape[::-1]
    if road.median_m > 0:
        xy = beside(np.column_stack([xy, np.zeros(len(xy))]), road.median_m / 2)[:, :2]
    lanes = [f'allow="pedestrian" width="{rules.sidewalk_width_m}"'] if road.sidewalk else []
    side = 0 if forward else 1
    if street.parking[side]:
        width_m = slanted_strip_m(rules) if street.slanted[side] else rules.parking_width_m
        lanes.append(f'disallow="all" width="{width_m:g}"')
    allowed = _DRIVERS if road.bicycles else _DRIVERS.replace(" bicycle", "")
    lanes += [f'allow="{allowed}" width="{road.lane_width_m}"'] * road.lanes
    if plan.edge(street, forward) in plan.tracks:
        lanes[-1] = lanes[-1].replace(allowed, f"{allowed} tram")
    head = f'    <edge id="{plan.edge(street, forward)}" from="{plan.names[start]}" to="{plan.names[end]}"'
    head += f' priority="{road.priority}" numLanes="{len(lanes)}" speed="{road.speed_kmh / 3.6:.2f}"'
    head += f' shape="{_points(xy, ground.height(xy))}">'
    return [head, *(f'        <lane index="{i}" {lane}/>' for i, lane in enumerate(lanes)), "    </edge>"]


def _points(xy: np.ndarray, z: np.ndarray) -> str:
    return " ".join(f"{x:.2f},{y:.2f},{h:.3f}" for (x, y), h in zip(xy, z, strict=True))
