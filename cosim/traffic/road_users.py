"""Road users among SUMO's vehicles and persons, with their kind and size."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from cosim.traffic.longer_routes import shared_type
from cosim.traffic.starting import TrafficError

# SUMO vehicle class → kind of road user
KIND_OF_CLASS = {
    "passenger": "car",
    "private": "car",
    "taxi": "car",
    "hov": "car",
    "evehicle": "car",
    "emergency": "van",
    "delivery": "van",
    "truck": "truck",
    "trailer": "truck",
    "bus": "bus",
    "coach": "bus",
    "tram": "tram",
    "rail_urban": "tram",
    "motorcycle": "motorcycle",
    "moped": "motorcycle",
    "bicycle": "cyclist",
    "custom1": "car",
    "custom2": "car",
    "ignoring": "car",
    "authority": "car",
    "vip": "car",
    "army": "truck",
    "scooter": "cyclist",
    "pedestrian": "pedestrian",
    "wheelchair": "pedestrian",
}
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _TypeInfo:
    kind: str
    size: tuple[float, float, float]


class RoadUsers:
    """Looks vTypes up, each once.

    Args:
        api: the running libsumo.
    """

    def __init__(self, api: ModuleType) -> None:
        self._sumo = api
        self._types: dict[str, _TypeInfo] = {}
        self._left_out: set[str] = set()
        self._dispatched: dict[str, bool] = {}

    def shows(self, api: Any, name: str) -> bool:
        """Return whether a vehicle class is a road user; trains, ships etc. are left out, with one note for each class.

        Args:
            api: libsumo's `vehicle` or `person`.
            name: who.
        """
        vehicle_class = self._sumo.vehicletype.getVehicleClass(api.getTypeID(name))
        if vehicle_class in KIND_OF_CLASS:
            return True
        if vehicle_class not in self._left_out:
            self._left_out.add(vehicle_class)
            _log.warning("who has vClass %r is not shown: only road users and people on foot are", vehicle_class)
        return False

    def dispatched(self, vehicle: str) -> bool:
        """Whether SUMO sends a vehicle to its passengers: it has a taxi device."""
        if vehicle not in self._dispatched:
            self._dispatched[vehicle] = self._sumo.vehicle.getParameter(vehicle, "has.taxi.device") == "true"
        return self._dispatched[vehicle]

    def on_rails(self, vehicle: str) -> bool:
        """Whether a vehicle is a tram."""
        return KIND_OF_CLASS.get(self._sumo.vehicle.getVehicleClass(vehicle)) == "tram"

    def looks(self, types: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...], np.ndarray]:
        """Shared vTypes, kinds and sizes (n, 3) [m] of road users by their vTypes.

        Raises:
            TrafficError: a vType is of no road user.
        """
        shared = tuple(shared_type(name) for name in types)
        infos = [self._type(name) for name in shared]
        return shared, tuple(info.kind for info in infos), np.array([info.size for info in infos], float).reshape(-1, 3)

    def _type(self, name: str) -> _TypeInfo:
        if name not in self._types:
            api = self._sumo.vehicletype
            vehicle_class = api.getVehicleClass(name)
            if vehicle_class not in KIND_OF_CLASS:
                known = ", ".join(sorted(KIND_OF_CLASS))
                raise TrafficError(f"vType {name!r} has vClass {vehicle_class!r}; cosim shows only {known}")
            size = (api.getLength(name), api.getWidth(name), api.getHeight(name))
            self._types[name] = _TypeInfo(KIND_OF_CLASS[vehicle_class], size)
        return self._types[name]
