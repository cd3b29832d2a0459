"""Drivable corners: rounded bends, closed turns where they are too sharp, and wider junctions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sumo_nets.plan import Plan, Street

_BEND_RAD = np.deg2rad(70)  # two streets that meet at less are joined by an arc
_BEND_RADIUS_M = 13.0  # of the street's middle line
_LONGEST_SHARE = 0.42  # maximum share of a street for an arc
_CLOSED_RAD = np.deg2rad(52)  # no turns between arms at smaller angles
_WIDE_RAD = np.deg2rad(70)
_WIDE_RADIUS_M = 8.0
_PIECE_M = 1.5


def ease_corners(plan: Plan) -> Plan:
    """Make every turn between two streets one that a car can take at walking pace.

    Where two streets meet at an acute angle and no third, both end in half an arc. Where more meet, turns of more than
    128° are closed and junctions with turns of more than 110° get wider corners. Streets with a cut of their own (ring
    roads, ramps, roundabouts) stay as they are laid out.
    """
    for node in range(len(plan.names)):
        arms = _arms(plan, node)
        if len(arms) == 2 and all(street.road is None for street in arms):
            plan = _round_off(plan, node, arms[0], arms[1])
    closed, radii = [], dict(plan.radii)
    for node, name in enumerate(plan.names):
        arms = [street for street in _arms(plan, node) if street.road is None]
        for i, one in enumerate(arms):
            for other in arms[i + 1 :]:
                between = _between(_outward(one, node), _outward(other, node))
                if between < _CLOSED_RAD:
                    closed += [_turn(plan, node, one, other), _turn(plan, node, other, one)]
                if between < _WIDE_RAD:
                    radii[name] = _WIDE_RADIUS_M
    return replace(plan, closed=tuple(closed), radii=radii)


def _arms(plan: Plan, node: int) -> list[Street]:
    return [street for street in plan.streets if node in (street.start, street.end)]


def _outward(street: Street, node: int) -> np.ndarray:
    """The direction (2,) in which a street leaves a junction."""
    shape = street.shape if street.start == node else street.shape[::-1]
    away = shape[1] - shape[0]
    return away / np.linalg.norm(away)


def _between(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.arccos(np.clip(one @ other, -1, 1)))


def _turn(plan: Plan, node: int, one: Street, other: Street) -> tuple[str, str]:
    return plan.edge(one, forward=one.end == node), plan.edge(other, forward=other.start == node)


def _round_off(plan: Plan, node: int, one: Street, other: Street) -> Plan:
    """Move a junction of two streets to the middle of an arc that both then share."""
    ways = [_outward(street, node) for street in (one, other)]
    between = _between(*ways)
    if between > _BEND_RAD:
        return plan
    longest = _LONGEST_SHARE * min(float(np.linalg.norm(s.shape[-1] - s.shape[0])) for s in (one, other))
    radius = min(_BEND_RADIUS_M, longest * np.tan(between / 2))
    tangent = radius / np.tan(between / 2)
    corner = plan.positions[node]
    inward = (ways[0] + ways[1]) / np.linalg.norm(ways[0] + ways[1])
    centre = corner + inward * radius / np.sin(between / 2)
    half_turn = (np.pi - between) / 2
    angles = np.linspace(0, half_turn, max(2, int(np.ceil(half_turn * radius / _PIECE_M)) + 1))
    streets = list(plan.streets)
    for street, way in zip((one, other), ways, strict=True):
        across = corner + way * tangent - centre  # from the centre to where the arc touches the street
        tangential = np.array([-across[1], across[0]])
        tangential *= np.sign(tangential @ -way)
        arc = centre + np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * tangential
        shape = street.shape if street.start == node else street.shape[::-1]
        beyond = (shape - corner) @ way > tangent + _PIECE_M
        shape = np.vstack([arc[::-1], shape[int(np.argmax(beyond)) :]])
        streets[next(i for i, kept in enumerate(streets) if kept is street)] = replace(
            street, shape=shape if street.start == node else shape[::-1]
        )
    positions = plan.positions.copy()
    positions[node] = centre - inward * radius
    return replace(plan, positions=positions, streets=tuple(streets))
