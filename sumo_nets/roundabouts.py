"""Roundabouts instead of the junctions of main streets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sumo_nets.plan import CIRCLE_PRIORITY, Plan, Road, Street
from sumo_nets.recipe import StreetRules

_SPEED_KMH = 30.0
_LANE_WIDTH_M = 4.0
_NARROWEST_RAD = np.deg2rad(40)  # between neighbouring arms
_SHAPE_STEP_M = 3.0
_APART_M = 120.0


def add_roundabouts(plan: Plan, rules: StreetRules) -> Plan:
    """Turn the busiest junctions, well apart, into roundabouts; never more than the rules want."""
    done: list[np.ndarray] = []
    for node in _busiest(plan):
        if len(done) == rules.roundabouts:
            break
        centre = plan.positions[node]
        if any(np.linalg.norm(centre - other) < _APART_M for other in done):
            continue
        cuts = [_cut(s, node, centre, rules.roundabout_m) for s in plan.streets if node in (s.start, s.end)]
        angles = np.sort([_angle(point - centre) for _, point in cuts])
        if len(cuts) >= 3 and np.diff([*angles, angles[0] + 2 * np.pi]).min() > _NARROWEST_RAD:
            plan = _circle(plan, node, rules.roundabout_m)
            done.append(centre)
    return plan


def _busiest(plan: Plan) -> list[int]:
    """Return the junctions with three arms or more: most main arms first, then most arms, then nearest the middle."""
    arms, main = plan.arms(), plan.arms(main_only=True)
    away = np.linalg.norm(plan.positions, axis=1)
    return [int(node) for node in np.lexsort((away, -arms, -main)) if arms[node] >= 3]


def _circle(plan: Plan, node: int, radius_m: float) -> Plan:
    centre, name = plan.positions[node], plan.names[node]
    names, positions = list(plan.names), list(plan.positions)
    streets, rim = [], []
    for street in plan.streets:
        if node not in (street.start, street.end):
            streets.append(street)
            continue
        shape, point = _cut(street, node, centre, radius_m)
        new = len(names)
        names.append(f"{name}r{len(rim)}")
        positions.append(point)
        rim.append((_angle(point - centre), new))
        ends = {"start": new} if street.start == node else {"end": new}
        streets.append(replace(street, shape=shape, **ends))
    road = Road(1, _LANE_WIDTH_M, _SPEED_KMH, CIRCLE_PRIORITY, oneway=True)
    rim.sort()
    for (angle, start), (stop, end) in zip(rim, [*rim[1:], rim[0]], strict=True):
        turn = (stop - angle) % (2 * np.pi)
        along = angle + np.linspace(0, turn, int(np.ceil(turn * radius_m / _SHAPE_STEP_M)) + 1)
        arc = centre + radius_m * np.stack([np.cos(along), np.sin(along)], axis=1)
        streets.append(Street(start, end, arc, road=road))
    controls = {**plan.controls, **{names[new]: "priority" for _, new in rim}}
    return replace(plan, names=tuple(names), positions=np.array(positions), streets=tuple(streets), controls=controls)


def _cut(street: Street, node: int, centre: np.ndarray, radius_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a street's shape without what lies within a radius of one of its ends, and its new end."""
    shape = street.shape if street.start == node else street.shape[::-1]
    away = np.linalg.norm(shape - centre, axis=1)
    first = int(np.argmax(away > radius_m))
    share = (radius_m - away[first - 1]) / (away[first] - away[first - 1])
    point = shape[first - 1] + share * (shape[first] - shape[first - 1])
    point = centre + radius_m * (point - centre) / np.linalg.norm(point - centre)
    shape = np.vstack([point, shape[first:]])
    return (shape if street.start == node else shape[::-1]), point


def _angle(vector: np.ndarray) -> float:
    return float(np.arctan2(vector[1], vector[0]))
