"""Extended routes, so that no vehicle is removed in the middle of a town."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from types import ModuleType

import numpy as np

_FEW_EDGES_LEFT = 4
_TRIES, _TRIES_STRAIGHT_ON = 20, 12


class LongerRoutes:
    """Adds random ways to routes that near their ends.

    Args:
        api: the running libsumo.
    """

    def __init__(self, api: ModuleType) -> None:
        self._sumo = api
        self._open: dict[str, list[str]] = {}  # vClass → edges

    def prolong(self, vehicle: str, rng: np.random.Generator) -> None:
        """Give a vehicle that nears its destination another one, straight on where that can be."""
        api = self._sumo.vehicle
        route = api.getRoute(vehicle)
        if len(route) - api.getRouteIndex(vehicle) > _FEW_EDGES_LEFT:
            return
        vehicle_class, vtype = api.getVehicleClass(vehicle), shared_type(api.getTypeID(vehicle))
        edges = self._open_edges(vehicle_class)
        for number in range(_TRIES):
            way = self._sumo.simulation.findRoute(route[-1], str(rng.choice(edges)), vtype).edges
            if len(way) > _FEW_EDGES_LEFT and (number >= _TRIES_STRAIGHT_ON or not self._turns_back(way)):
                api.setRoute(vehicle, [*route[api.getRouteIndex(vehicle) :], *way[1:]])
                return

    def _open_edges(self, vehicle_class: str) -> list[str]:
        """Edges with a lane that a vClass may use; sidewalks are lanes too."""
        if vehicle_class not in self._open:
            api = self._sumo
            closed = api.lane.getDisallowed
            self._open[vehicle_class] = [
                edge
                for edge in sorted(api.edge.getIDList())
                if not edge.startswith(":")
                and any(vehicle_class not in closed(f"{edge}_{i}") for i in range(api.edge.getLaneNumber(edge)))
            ]
        return self._open[vehicle_class]

    def _turns_back(self, way: Sequence[str]) -> bool:
        """Whether a way goes back somewhere on the street it came on."""
        api = self._sumo.edge
        return any(api.getFromJunction(one) == api.getToJunction(other) for one, other in pairwise(way))


def shared_type(name: str) -> str:
    """The vType that SUMO made a single vehicle's own type from."""
    return name.partition("@")[0]
