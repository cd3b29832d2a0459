"""Scenarios of ASAM OpenSCENARIO XML 1.x whose road users follow trajectories defined in the file.

ASAM OpenSCENARIO 1.3, 7.4.1.3 and class FollowTrajectoryAction: positions are those of an entity's origin, for vehicles
the middle of the rear axle; headings count counter-clockwise from x. The file is parsed by scenariogeneration.
"""

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

import numpy as np

from cosim.traffic.trajectories.kinds import user_of
from cosim.traffic.trajectories.tracks import RoadTracks, TrackSample, TrajectoryError, User, gather
from cosim.traffic.trajectories.xosc_parameters import resolve_entry, resolve_parameters
from sumo_nets.errors import TownError
from sumo_nets.xml_guard import read_xml

_EVERY_S = 0.1
_STARTS_S = 0.05  # a trajectory that starts so soon starts immediately
_REMEDY = (
    "only trajectories as polylines of world positions with times are replayed: play it elsewhere, and give a table"
)
_ENTITIES = ("Vehicle", "Pedestrian", "MiscObject")
# attributes that are optional in the standard, with the default 0
_OPTIONAL = {
    "LanePosition": ("offset",),
    "RelativeLanePosition": ("offset",),
    "RelativeObjectPosition": ("dz",),
    "RelativeWorldPosition": ("dz",),
}
_WORDS = {"motorbike": "motorcycle", "wheelchair": "pedestrian"}


@dataclass
class _Way:
    """Motion of one entity: initial position, and trajectories as rows of time [s], x, y, z [m], heading."""

    stands: np.ndarray | None
    trajectories: list[np.ndarray]


def read_openscenario(path: Path, root: ET.Element, left_out: Counter[str]) -> RoadTracks:
    """Tracks of an `OpenSCENARIO` document; who is no road user is counted in `left_out`.

    Raises:
        TrajectoryError: an entity's motion is not an explicit trajectory, a value is missing, or see `gather`; or the
            library that reads such files is missing.
    """
    if root.find("ParameterValueDistribution") is not None:
        raise TrajectoryError(
            f"{path}: contains distributions of parameter values, not a scenario; give the scenario that they vary"
        )
    xosc = _library()
    resolve_parameters(str(path), root)
    scenario = _parse(path, "the scenario", xosc.Scenario.parse, root, xosc)
    assigned = _assignments(root)
    users = _users(path, scenario, xosc, assigned, left_out)
    ways = {name: _Way(None, []) for name in users}
    _initial(path, scenario, xosc, ways)
    for story in scenario.storyboard.stories:
        _defined_speed(path, story, xosc, ways)
    end_s = max((rows[-1, 0] for way in ways.values() for rows in way.trajectories), default=0.0)
    samples = [sample for name, way in ways.items() for sample in _samples(path, name, way, end_s)]
    return gather(path, samples, users, centred=True)


def _library() -> Any:
    try:
        return import_module("scenariogeneration.xosc")
    except ImportError:
        raise TrajectoryError("OpenSCENARIO needs scenariogeneration; `pip install 'cosim[openscenario]'`") from None


def _complaints(xosc: Any) -> tuple[type[Exception], ...]:
    return tuple(one for one in vars(xosc.exceptions).values() if isinstance(one, type) and issubclass(one, Exception))


def _parse(path: Path, what: str, parse: Callable[[ET.Element], Any], element: ET.Element, xosc: Any) -> Any:
    """Parse an element with the library.

    Raises:
        TrajectoryError: the library cannot parse it.
    """
    for tag, attributes in _OPTIONAL.items():
        for position in element.iter(tag):
            for name in attributes:
                position.set(name, position.get(name) or "0")
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


def _assignments(root: ET.Element) -> dict[str, dict[str, str]]:
    """Values that each entity assigns to parameters of its catalogue entry."""
    return {
        thing.get("name", ""): {
            assignment.get("parameterRef", "").removeprefix("$"): assignment.get("value", "")
            for assignment in thing.findall("CatalogReference/ParameterAssignments/ParameterAssignment")
        }
        for thing in root.iter("ScenarioObject")
    }


def _users(
    path: Path, scenario: Any, xosc: Any, assigned: Mapping[str, Mapping[str, str]], left_out: Counter[str]
) -> dict[str, User]:
    users: dict[str, User] = {}
    for one in scenario.entities.scenario_objects:
        entity = one.entityobject
        if isinstance(entity, xosc.CatalogReference):
            entity = _catalogued(path, scenario, xosc, entity, assigned.get(one.name, {}))
        user = _user(entity, xosc)
        if user is None:
            left_out[type(entity).__name__] += 1
        else:
            users[one.name] = user
    return users


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
            if catalog is None or catalog.get("name") != reference.catalogname:
                continue
            for entry in catalog:
                if entry.get("name") == reference.entryname and entry.tag in _ENTITIES:
                    what = f"{entry.tag} {reference.entryname!r}"
                    resolve_entry(f"{file}: {what}", entry, assigned)
                    return _parse(file, what, getattr(xosc, entry.tag).parse, entry, xosc)
    raise TrajectoryError(
        f"{path}: {reference.entryname!r} of catalogue {reference.catalogname!r} is in no folder of its "
        "CatalogLocations; put the catalogue there"
    )


def _initial(path: Path, scenario: Any, xosc: Any, ways: dict[str, _Way]) -> None:
    for name, actions in scenario.storyboard.init.initactions.items():
        if name in ways:
            for action in actions:
                _take(path, name, action, xosc, ways[name], 0.0)


def _defined_speed(path: Path, story: Any, xosc: Any, ways: dict[str, _Way]) -> None:
    """Trajectories of a story's events."""
    for act in story.acts:
        for group in act.maneuvergroup:
            names = [one.entity for one in group.actors.actors if one.entity in ways]
            if names and any(isinstance(maneuver, xosc.CatalogReference) for maneuver in group.maneuvers):
                raise TrajectoryError(f"{path}: {names[0]!r} has a manoeuvre of a catalogue, {_REMEDY}")
            maneuvers = group.maneuvers if names else []
            for event in (event for maneuver in maneuvers for event in maneuver.events):
                for name in names:
                    begins = [_begin_s(path, trigger, xosc) for trigger in (act.starttrigger, event.trigger)]
                    start_s = None if None in begins else max(one for one in begins if one is not None)
                    for action in event.action:
                        _take(path, name, action.action, xosc, ways[name], start_s)


def _take(path: Path, name: str, action: Any, xosc: Any, way: _Way, start_s: float | None) -> None:
    """Add the part of an entity's motion that an action defines.

    Args:
        path: for messages.
        name: of the entity.
        action: of the library.
        xosc: the library.
        way: is added to.
        start_s: start time; None if it is known only in simulation.
    """
    if isinstance(action, xosc.TeleportAction) and start_s == 0:
        way.stands = _position(path, name, action.position, xosc)
    elif isinstance(action, xosc.FollowTrajectoryAction):
        way.trajectories.append(_rows(path, name, action, xosc, start_s))
    elif isinstance(action, xosc.AbsoluteSpeedAction) and start_s == 0:
        return  # trajectories with times define speeds themselves
    elif not isinstance(action, (xosc.ControllerAction, xosc.ActivateControllerAction, xosc.VisibilityAction)):
        raise TrajectoryError(f"{path}: {name!r} does a {type(action).__name__}, {_REMEDY}")


def _rows(path: Path, name: str, action: Any, xosc: Any, start_s: float | None) -> np.ndarray:
    """A trajectory as rows of time, x, y, z, heading."""
    trajectory, timing = action.trajectory, action.timeref
    if not (isinstance(trajectory, xosc.Trajectory) and isinstance(trajectory.shapes, xosc.Polyline)):
        raise TrajectoryError(f"{path}: the trajectory of {name!r} is no polyline, {_REMEDY}")
    shape = trajectory.shapes
    if not shape.time or timing.scale is None:
        raise TrajectoryError(f"{path}: the trajectory of {name!r} has no times, {_REMEDY}")
    if timing.reference_domain.get_name() == "relative" and start_s is None:
        raise TrajectoryError(f"{path}: the trajectory of {name!r} starts when a traffic condition is met, {_REMEDY}")
    begins_s = start_s if timing.reference_domain.get_name() == "relative" else 0.0
    times = np.array(shape.time, float) * float(timing.scale) + float(timing.offset) + (begins_s or 0.0)
    places = np.array([_position(path, name, one, xosc) for one in shape.positions])
    if (np.diff(times) <= 0).any() or not np.isfinite(times).all():
        raise TrajectoryError(f"{path}: times of the trajectory of {name!r} do not grow; order its vertices by time")
    return np.column_stack([times, places])


def _position(path: Path, name: str, position: Any, xosc: Any) -> np.ndarray:
    """World position: x, y, z, heading, the last two NaN if not given."""
    if not isinstance(position, xosc.WorldPosition):
        raise TrajectoryError(f"{path}: {name!r} has a {type(position).__name__}, {_REMEDY}")
    values = [math.nan if value is None else value for value in (position.x, position.y, position.z, position.h)]
    return np.array(values, float)


def _begin_s(path: Path, trigger: Any, xosc: Any) -> float | None:
    """Time at which a trigger fires that depends only on simulation time; None for others."""
    groups = getattr(trigger, "conditiongroups", None) or ([trigger] if getattr(trigger, "conditions", None) else [])
    if trigger is None or not (groups or isinstance(trigger, xosc.ValueTrigger)):
        return 0.0  # without conditions it fires at once
    conditions = [one for group in groups for one in group.conditions] or [trigger]
    values = [getattr(one, "valuecondition", None) for one in conditions]
    if len(groups) > 1 or not all(isinstance(one, xosc.SimulationTimeCondition) for one in values):
        return None
    if any(one.rule.get_name() not in ("greaterThan", "greaterOrEqual") for one in values if one is not None):
        return None
    return max(float(one.value) for one in values if one is not None)


def _samples(path: Path, name: str, way: _Way, end_s: float) -> list[TrackSample]:
    """An entity's track at 10 Hz; its initial position until its trajectory starts, or throughout."""
    ways = sorted(way.trajectories, key=lambda rows: rows[0, 0])
    if not ways and way.stands is None:
        raise TrajectoryError(f"{path}: nothing says where {name!r} is; give a TeleportAction or a trajectory")
    parts = [_dense(rows) for rows in ways]
    if way.stands is not None and (not parts or parts[0][0, 0] > _STARTS_S):
        until_s = parts[0][0, 0] - _EVERY_S / 2 if parts else max(end_s, 1.0)
        times = np.append(np.arange(0.0, until_s, _EVERY_S), until_s)
        parts.insert(0, np.column_stack([times, np.tile(way.stands, (len(times), 1))]))
    return [
        TrackSample(
            time_s=float(time_s), user=name, x_m=float(x), y_m=float(y), z_m=float(z), heading_rad=float(heading)
        )
        for time_s, x, y, z, heading in np.concatenate(parts)
    ]


def _dense(rows: np.ndarray) -> np.ndarray:
    """Rows of a polyline with others between its vertices, which are kept."""
    steps = np.arange(rows[0, 0], rows[-1, 0], _EVERY_S)
    far = np.abs(steps[:, None] - rows[None, :, 0]).min(1) > _EVERY_S / 4
    times = np.sort(np.concatenate([steps[far], rows[:, 0]]))
    heading = np.unwrap(rows[:, 4]) if np.isfinite(rows[:, 4]).all() else rows[:, 4]
    columns = [*rows[:, 1:4].T, heading]
    return np.column_stack([times, *(np.interp(times, rows[:, 0], column) for column in columns)])
