"""Choice of routes, and their extension, so that no vehicle is removed in the middle of a town."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cosim.traffic.behaviour.free_driving import MOTORISED
from cosim.traffic.behaviour.stage import Stage

_TRIES = 12
_LEGS = 6
_SHORTEST = 4
_LOOKS_EVERY_STEPS = 50


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


class Onward:
    """Gives drivers who near the end of their route another one, so that they do not vanish there."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def step(self, stage: Stage) -> None:
        """Look at all routes now and then."""
        actors = stage.actors
        if round(actors.time_s / stage.step_s) % _LOOKS_EVERY_STEPS:
            return
        for vehicle in sorted(stage.traffic.far):
            stage.traffic.prolong_route(vehicle, self._rng)
        for row, vehicle in enumerate(actors.ids):
            drives = actors.kinds[row] in MOTORISED and actors.lanes[row] and not actors.parked[row]
            if drives and vehicle not in stage.busy:
                stage.traffic.prolong_route(vehicle, self._rng)
