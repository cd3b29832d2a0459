"""Choice of routes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cosim.traffic.behaviour.stage import Stage

_TRIES = 12
_LEGS = 6
_SHORTEST = 4


def wander(stage: Stage, vehicle: str, edge: str, rng: np.random.Generator) -> list[str] | None:
    """Return a long route (edges) from an edge through random edges of the town; None if the edge is a dead end."""
    edges = sorted(name for name in stage.roads.of_edge if not name.startswith(":"))
    vtype, route = stage.actors.types[stage.rows[vehicle]], [edge]
    legs = 0
    for _ in range(_TRIES):
        target = edges[int(rng.integers(len(edges)))]
        way = stage.api.simulation.findRoute(route[-1], target, vtype).edges
        turns_back = any(stage.roads.back.get(a) == b for a, b in pairwise(way))
        if len(way) >= _SHORTEST and not turns_back:
            route += way[1:]
            legs += 1
        if legs == _LEGS:
            break
    return route if legs else None
