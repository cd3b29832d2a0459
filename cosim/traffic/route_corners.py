"""Routes of long vehicles avoid corners that are too tight for them."""

from __future__ import annotations

from itertools import pairwise
from types import ModuleType

import numpy as np

from cosim.traffic.motion.corners import longest_body, sharpest_radius

_LONG_M = 9.0  # who is shorter takes every corner of a town
_MOST_LANES = 4  # inside one junction


class RouteCorners:
    """Replaces who is too long for the corners of his route by the longest of his vClass that is not.

    Args:
        api: the running libsumo.
    """

    def __init__(self, api: ModuleType) -> None:
        self._api = api
        self._radius: dict[tuple[str, str], float] = {}
        self._shorter: dict[str, list[tuple[float, str]]] = {}

    def fit(self, vehicle: str) -> None:
        """Look at a vehicle that has just entered; where none of its vClass fits, the shortest takes its place."""
        api = self._api
        length = api.vehicle.getLength(vehicle)
        if length < _LONG_M:
            return
        route = api.vehicle.getRoute(vehicle)
        longest = longest_body(min((self._tightest(*pair) for pair in pairwise(route)), default=np.inf))
        if length <= longest:
            return
        types = self._types(api.vehicle.getVehicleClass(vehicle))
        fits = [name for size, name in types if size <= longest] or [types[0][1]]
        if fits[-1] != api.vehicle.getTypeID(vehicle):
            api.vehicle.setType(vehicle, fits[-1])

    def _types(self, vehicle_class: str) -> list[tuple[float, str]]:
        """Lengths and names of the types of a vClass, the shortest first; not SUMO's own defaults."""
        if vehicle_class not in self._shorter:
            api = self._api.vehicletype
            names = [name for name in api.getIDList() if not name.startswith("DEFAULT_") and "@" not in name]
            same = [name for name in names if api.getVehicleClass(name) == vehicle_class]
            self._shorter[vehicle_class] = sorted((api.getLength(name), name) for name in same)
        return self._shorter[vehicle_class]

    def _tightest(self, edge: str, onward: str) -> float:
        """Radius of the widest way from an edge to the next at its sharpest bend [m]."""
        key = (edge, onward)
        if key not in self._radius:
            api, found = self._api, []
            for index in range(api.edge.getLaneNumber(edge)):
                for link in api.lane.getLinks(f"{edge}_{index}"):
                    if link[0].rpartition("_")[0] == onward:
                        found.append(self._across(link[4]))
            self._radius[key] = max(found, default=np.inf)
        return self._radius[key]

    def _across(self, via: str) -> float:
        api, shape = self._api.lane, []
        for _ in range(_MOST_LANES):
            if not via:
                break
            shape += api.getShape(via)
            links = api.getLinks(via)
            via = links[0][4] if links else ""
        return sharpest_radius(np.array(shape)) if shape else np.inf
