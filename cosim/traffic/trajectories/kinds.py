"""Names of road users in data sets, and default sizes for files that do not state them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

from cosim.traffic.road_users import KIND_OF_CLASS
from cosim.traffic.trajectories.tracks import User
from sumo_nets.xml_guard import read_xml

# Mean length, width, height of KITTI's labels [m]; buses and motorcycles as SUMO's vClasses have them.
_SIZES = {
    "car": (3.88, 1.63, 1.53),
    "van": (5.07, 1.90, 2.21),
    "truck": (10.1, 2.59, 3.25),
    "bus": (12.0, 2.5, 3.4),
    "tram": (15.0, 2.4, 3.4),
    "motorcycle": (2.2, 0.9, 1.5),
    "cyclist": (1.76, 0.60, 1.74),
    "pedestrian": (0.84, 0.66, 1.76),
}
# SUMO user documentation, Vehicle Type Parameter Defaults: length, width, height of a vClass without its own.
_CLASS_SIZES = {
    "passenger": (5.0, 1.8, 1.5),
    "delivery": (6.5, 2.16, 2.86),
    "emergency": (6.5, 2.16, 2.86),
    "truck": (7.1, 2.4, 2.4),
    "trailer": (16.5, 2.55, 4.0),
    "bus": (12.0, 2.5, 3.4),
    "coach": (14.0, 2.6, 4.0),
    "tram": (22.0, 2.4, 3.2),
    "rail_urban": (109.5, 3.0, 3.6),
    "motorcycle": (2.2, 0.9, 1.5),
    "moped": (2.1, 0.8, 1.7),
    "bicycle": (1.6, 0.65, 1.7),
    "scooter": (1.2, 0.5, 1.7),
    "pedestrian": (0.215, 0.478, 1.719),
}
# Words of Argoverse 1 and 2, Waymo (also its numbers), nuScenes, INTERACTION, highD and CommonRoad.
_WORDS = {
    "car": ("car", "vehicle", "agent", "av", "others", "type_vehicle", "1", "taxi", "passenger", "parkedvehicle"),
    "van": ("van", "delivery", "priorityvehicle"),
    "truck": ("truck", "large_vehicle", "vehicular_trailer", "truck_cab", "box_truck"),
    "bus": ("bus", "school_bus", "articulated_bus"),
    "tram": ("tram",),
    "motorcycle": ("motorcycle", "motorcyclist", "moped"),
    "cyclist": ("cyclist", "bicycle", "bicyclist", "type_cyclist", "3", "wheeled_rider"),
    "pedestrian": ("pedestrian", "person", "type_pedestrian", "2", "pedestrian/bicycle"),
}
_KIND_OF_WORD = {word: kind for kind, words in _WORDS.items() for word in words}


def user_of(word: str, size_m: tuple[float | None, float | None, float | None] = (None, None, None)) -> User | None:
    """Road user that a data set's word means; None if it is not one. Missing sizes are those of the kind."""
    kind = _KIND_OF_WORD.get(word.strip().lower())
    if kind is None:
        return None
    usual = _SIZES[kind]
    length, width, height = (own if own else mean for own, mean in zip(size_m, usual, strict=True))
    return User(word, kind, (length, width, height))


def sumo_types(files: Iterable[Path]) -> dict[str, User]:
    """Road users that the vTypes of SUMO's files describe, by id.

    Raises:
        TownError: a file cannot be read.
    """
    found = {"DEFAULT_VEHTYPE": _of_class("DEFAULT_VEHTYPE", "passenger", {})}
    found["DEFAULT_PEDTYPE"] = _of_class("DEFAULT_PEDTYPE", "pedestrian", {})
    found["DEFAULT_BIKETYPE"] = _of_class("DEFAULT_BIKETYPE", "bicycle", {})
    for path in files:
        for element in read_xml(path).iter("vType"):
            name, vehicle_class = element.get("id", ""), element.get("vClass", "passenger")
            if vehicle_class in KIND_OF_CLASS:
                found[name] = _of_class(name, vehicle_class, element.attrib)
    return found


def _of_class(name: str, vehicle_class: str, given: dict[str, str] | ET.Element) -> User:
    usual = _CLASS_SIZES.get(vehicle_class, _CLASS_SIZES["passenger"])
    length, width, height = (
        float(given.get(key, default)) for key, default in zip(("length", "width", "height"), usual, strict=True)
    )
    return User(name, KIND_OF_CLASS[vehicle_class], (length, width, height))
