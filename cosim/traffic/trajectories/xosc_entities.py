"""Road users of an OpenSCENARIO file, also those of catalogues, and the library that parses it (scenariogeneration)."""

from __future__ import annotations

import contextlib
import io
import math
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from cosim.traffic.trajectories.kinds import user_of
from cosim.traffic.trajectories.tracks import TrajectoryError, User
from cosim.traffic.trajectories.xosc_parameters import resolve_entry
from sumo_nets.errors import TownError
from sumo_nets.xml_guard import read_xml

_ENTITIES = ("Vehicle", "Pedestrian", "MiscObject")
# attributes that are optional in the standard, with the default 0
_OPTIONAL = {
    "LanePosition": ("offset",),
    "RelativeLanePosition": ("offset",),
    "RelativeObjectPosition": ("dz",),
    "RelativeWorldPosition": ("dz",),
}
_WORDS = {"motorbike": "motorcycle", "wheelchair": "pedestrian"}
_AT_ONCE = """<StartTrigger><ConditionGroup><Condition name="at once" delay="0" conditionEdge="none">
<ByValueCondition><SimulationTimeCondition value="0" rule="greaterOrEqual"/></ByValueCondition>
</Condition></ConditionGroup></StartTrigger>"""


def load_library() -> Any:
    """The library's module for OpenSCENARIO.

    Raises:
        TrajectoryError: it is not installed.
    """
    try:
        return import_module("scenariogeneration.xosc")
    except ImportError:
        raise TrajectoryError("OpenSCENARIO needs scenariogeneration; `pip install 'cosim[openscenario]'`") from None


def _complaints(xosc: Any) -> tuple[type[Exception], ...]:
    return tuple(one for one in vars(xosc.exceptions).values() if isinstance(one, type) and issubclass(one, Exception))


def parse_element(path: Path, what: str, parse: Callable[[ET.Element], Any], element: ET.Element, xosc: Any) -> Any:
    """Parse an element with the library.

    Raises:
        TrajectoryError: the library cannot parse it.
    """
    _complete(element)
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # the library prints elements
            return parse(element)
    except (ValueError, TypeError, LookupError, AttributeError, NotImplementedError, *_complaints(xosc)) as error:
        reason = re.sub(r"<Element '(\w+)' at 0x\w+>", r"\1", " ".join(str(error).split()))
        raise TrajectoryError(
            f"{path}: scenariogeneration cannot parse {what} ({type(error).__name__}: {reason[:200]}): an element is "
            "wrong, or of a version of the standard that this library does not know; correct or remove it, or give a "
            "table of trajectories"
        ) from error


def _complete(element: ET.Element) -> None:
    """Write out what the standard lets a file omit and the library requires."""
    for tag, attributes in _OPTIONAL.items():
        for position in element.iter(tag):
            for name in attributes:
                position.set(name, position.get(name) or "0")
    for event in element.iter("Event"):
        if event.find("StartTrigger") is None:  # optional: the event starts with its act
            event.append(ET.fromstring(_AT_ONCE))
    for clothoid in element.iter("Clothoid"):
        if "curvatureDot" in clothoid.attrib:  # its name before version 1.1, which the library reads wrongly
            clothoid.set("curvaturePrime", clothoid.attrib.pop("curvatureDot"))


def parameter_assignments(root: ET.Element) -> dict[str, dict[str, str]]:
    """Values that each entity assigns to parameters of its catalogue entry."""
    return {
        thing.get("name", ""): {
            assignment.get("parameterRef", "").removeprefix("$"): assignment.get("value", "")
            for assignment in thing.findall("CatalogReference/ParameterAssignments/ParameterAssignment")
        }
        for thing in root.iter("ScenarioObject")
    }


@dataclass(frozen=True)
class Limits:
    """Performance of a vehicle: highest speed [m/s], acceleration and deceleration [m/s²]."""

    speed_mps: float = math.inf
    acceleration_mps2: float = math.inf
    deceleration_mps2: float = math.inf


def read_users(
    path: Path, scenario: Any, xosc: Any, assigned: Mapping[str, Mapping[str, str]], left_out: Counter[str]
) -> tuple[dict[str, User], dict[str, Limits]]:
    """Road users, and the performance of each, by name; other entities are counted in `left_out`."""
    users: dict[str, User] = {}
    limits: dict[str, Limits] = {}
    for one in scenario.entities.scenario_objects:
        entity = one.entityobject
        if isinstance(entity, xosc.CatalogReference):
            entity = _catalogued(path, scenario, xosc, entity, assigned.get(one.name, {}))
        user = _user(entity, xosc)
        if user is None:
            left_out[type(entity).__name__] += 1
        else:
            users[one.name] = user
            limits[one.name] = _limits(entity)
    return users, limits


def _limits(entity: Any) -> Limits:
    """Performance of an entity; values that are not positive are no limits."""
    dynamics = getattr(entity, "dynamics", None)
    names = ("max_speed", "max_acceleration", "max_deceleration")
    values = (float(getattr(dynamics, name, None) or 0.0) for name in names)
    return Limits(*(value if value > 0 else math.inf for value in values))


def _user(entity: Any, xosc: Any) -> User | None:
    """Road user that an entity describes; None if it is not one."""
    if isinstance(entity, xosc.Vehicle):
        word = entity.vehicle_type.get_name()
    elif isinstance(entity, xosc.Pedestrian):
        word = entity.category.get_name()
    else:
        return None
    box = entity.boundingbox
    size = box.boundingbox
    found = user_of(_WORDS.get(word) or word, (size.length, size.width, size.height))
    return None if found is None else User(found.type, found.kind, found.size_m, middle_ahead_m=float(box.center.x))


def _catalogued(path: Path, scenario: Any, xosc: Any, reference: Any, assigned: Mapping[str, str]) -> Any:
    """An entity of a catalogue next to the scenario file.

    Raises:
        TrajectoryError: there is no such entry.
    """
    for folder in scenario.catalog.catalogs.values():
        for file in sorted((path.parent / str(folder)).glob("*.xosc")):
            try:
                catalog = read_xml(file, "OpenSCENARIO").find("Catalog")
            except TownError as error:
                raise TrajectoryError(str(error)) from error
            if catalog is None or reference.catalogname not in (catalog.get("name"), file.stem):
                continue
            for entry in catalog:
                if entry.get("name") == reference.entryname and entry.tag in _ENTITIES:
                    what = f"{entry.tag} {reference.entryname!r}"
                    resolve_entry(f"{file}: {what}", entry, assigned)
                    return parse_element(file, what, getattr(xosc, entry.tag).parse, entry, xosc)
    raise TrajectoryError(
        f"{path}: {reference.entryname!r} of catalogue {reference.catalogname!r} is in no folder of its "
        "CatalogLocations; put the catalogue there"
    )
