"""Transport on demand with SUMO's own dispatcher, for scenarios that leave dispatching to an external program.

SUMO sends vehicles with a taxi device to persons whose rides have the line `taxi` (SUMO's documentation, "Taxi"). A
scenario for an outside dispatcher has rides with any line, and vehicles that wait at a stop until they are dispatched.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Literal

from sumo_nets.errors import TownError
from sumo_nets.scenario import Scenario
from sumo_nets.xml_guard import read_xml

Algorithm = Literal["greedy", "greedyClosest", "greedyShared", "routeExtension"]

_TAXI = "has.taxi.device"
_STANDS_S = 3600.0  # a stop so long is the place where a vehicle waits to be sent
_ANY_LINE = frozenset({"", "ANY"})
_VEHICLES = frozenset({"vehicle", "trip", "flow"})


def with_dispatcher(scenario: Scenario, algorithm: Algorithm) -> Scenario:
    """A scenario whose vehicles on demand are sent by SUMO.

    Vehicles that are taxis already are not changed. If there are none, those that wait at a last stop for an hour
    or longer become taxis, and rides with any line, or with one that no vehicle has, become rides by taxi.

    Args:
        scenario: as its owner has it.
        algorithm: of SUMO's `device.taxi.dispatch-algorithm`.

    Raises:
        TownError: no vehicle in it waits for dispatch.
    """
    options = {**scenario.options, "device.taxi.dispatch-algorithm": algorithm}
    roots = {
        path: ET.fromstring(scenario.changed[path]) if path in scenario.changed else read_xml(path)
        for option in ("additional-files", "route-files")
        for path in scenario.files.get(option, ())
    }
    if any(_has_taxis(root) for root in roots.values()):
        return replace(scenario, options=options)
    waiting = [vehicle for root in roots.values() for vehicle in root if _waits(vehicle)]
    if not waiting:
        raise TownError(
            f"{scenario.config}: no vehicle has a taxi device ({_TAXI}) or waits at a last stop for an hour, so there "
            "is nothing to dispatch; leave taxi_dispatch out"
        )
    for vehicle in waiting:
        vehicle.attrib.pop("line", None)  # SUMO names the line of taxis
        ET.SubElement(vehicle, "param", key=_TAXI, value="true")
        for stop in vehicle.findall("stop"):
            if _seconds(stop.get("duration")) >= _STANDS_S:
                vehicle.remove(stop)
    served = {
        str(vehicle.get("line"))
        for root in roots.values()
        for vehicle in root
        if vehicle.tag in _VEHICLES and vehicle.get("line") and vehicle not in waiting
    }
    for root in roots.values():
        for ride in root.iter("ride"):
            if not (set(ride.get("lines", "").split()) - _ANY_LINE) & served:
                ride.set("lines", "taxi")
    changed = {path: ET.tostring(root, encoding="utf-8", xml_declaration=True) for path, root in roots.items()}
    return replace(scenario, options=options, changed={**scenario.changed, **changed})


def _has_taxis(root: ET.Element) -> bool:
    return any(
        param.get("key") == _TAXI and param.get("value") in ("true", "1")
        for element in root
        if element.tag in _VEHICLES | {"vType"}
        for param in element.findall("param")
    )


def _waits(vehicle: ET.Element) -> bool:
    """Whether a vehicle waits at its last stop until it is dispatched."""
    stops = vehicle.findall("stop")
    return vehicle.tag in _VEHICLES and bool(stops) and _seconds(stops[-1].get("duration")) >= _STANDS_S


def _seconds(text: str | None) -> float:
    try:
        return float(text or 0)
    except ValueError:
        return 0.0
