"""Scenarios of ASAM OpenSCENARIO XML 1.x whose motions are determined by the file.

These are explicit trajectories, and vehicles that keep lane and speed between actions that start at known times.
ASAM OpenSCENARIO 1.3, 7.4.1 and class FollowTrajectoryAction: positions are those of an entity's origin, for vehicles
the middle of the rear axle; headings count counter-clockwise from x. The file is parsed by scenariogeneration.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from cosim.traffic.trajectories.tracks import RoadTracks, TrajectoryError, gather
from cosim.traffic.trajectories.xosc_driving import Transition
from cosim.traffic.trajectories.xosc_entities import load_library, parameter_assignments, parse_element, read_users
from cosim.traffic.trajectories.xosc_locations import Locations
from cosim.traffic.trajectories.xosc_motion import (
    REMEDY,
    LaneAction,
    ScenarioMotion,
    SpeedAction,
    TrajectoryAction,
    Way,
)
from cosim.traffic.trajectories.xosc_parameters import resolve_parameters

_WITHOUT_MOTION = (
    "VisibilityAction",
    "LightStateAction",
    "AnimationAction",
    "EnvironmentAction",
    "TrafficSignalStateAction",
    "TrafficSignalControllerAction",
    "ParameterSetAction",
    "ParameterAddAction",
    "ParameterMultiplyAction",
    "VariableSetAction",
    "VariableAddAction",
    "VariableMultiplyAction",
)
_AFTER = ("greaterThan", "greaterOrEqual", "equalTo")


def read_openscenario(path: Path, root: ET.Element, left_out: Counter[str]) -> RoadTracks:
    """Tracks of an `OpenSCENARIO` document; who is no road user is counted in `left_out`.

    Raises:
        TrajectoryError: an entity's motion is known only in simulation, a value is missing, or see `gather`; or the
            library that reads such files is missing.
    """
    if root.find("ParameterValueDistribution") is not None:
        raise TrajectoryError(
            f"{path}: contains distributions of parameter values, not a scenario; give the scenario that they vary"
        )
    if root.find("Catalog") is not None:
        raise TrajectoryError(f"{path}: is a catalogue, not a scenario; give a scenario that refers to it")
    xosc = load_library()
    resolve_parameters(str(path), root)
    scenario = parse_element(path, "the scenario", xosc.Scenario.parse, root, xosc)
    users, limits = read_users(path, scenario, xosc, parameter_assignments(root), left_out)
    if not users:
        raise TrajectoryError(f"{path}: has no vehicle or pedestrian; give a scenario with road users")
    ways = {name: Way() for name in users}
    initial = _take_initial(path, scenario, xosc, ways)
    for story in scenario.storyboard.stories:
        _take_story(path, story, xosc, ways)
    locations = Locations(path, scenario.roadnetwork.road_file or "", initial, xosc)
    motion = ScenarioMotion(path, locations, ways, limits, xosc)
    end_s = motion.end_s(_first_time_s(scenario.storyboard.stoptrigger, xosc))
    samples = [sample for name in ways for sample in motion.samples(name, end_s)]
    tracks = gather(path, samples, users, centred=True)
    return replace(tracks, notes=(*tracks.notes, *(f"{path}: {note}" for note in motion.notes)))


def _take_initial(path: Path, scenario: Any, xosc: Any, ways: Mapping[str, Way]) -> dict[str, list[Any]]:
    """Initial positions of each entity, of the library; other initial actions are added to `ways`."""
    positions: dict[str, list[Any]] = {}
    for name, actions in scenario.storyboard.init.initactions.items():
        for action in actions:
            if isinstance(action, xosc.TeleportAction):
                positions.setdefault(name, []).append(action.position)
            elif name in ways:
                _take(path, name, action, xosc, ways[name], 0.0, ())
    return positions


def _take_story(path: Path, story: Any, xosc: Any, ways: Mapping[str, Way]) -> None:
    """Actions of a story's events."""
    for act in story.acts:
        for group in act.maneuvergroup:
            names = [one.entity for one in group.actors.actors if one.entity in ways]
            if names and any(isinstance(maneuver, xosc.CatalogReference) for maneuver in group.maneuvers):
                raise TrajectoryError(
                    f"{path}: {names[0]!r} has a manoeuvre of a catalogue, which is not read: {REMEDY}"
                )
            maneuvers = group.maneuvers if names else []
            for event in (event for maneuver in maneuvers for event in maneuver.events):
                triggers = (act.starttrigger, event.trigger)
                begins = [_first_time_s(trigger, xosc) for trigger in triggers]
                start_s = None if None in begins else max(one for one in begins if one is not None)
                unknown = tuple(dict.fromkeys(word for each in triggers for word in _unknown_conditions(each, xosc)))
                for name in names:
                    for action in event.action:
                        _take(path, name, action.action, xosc, ways[name], start_s, unknown)


def _take(
    path: Path, name: str, action: Any, xosc: Any, way: Way, start_s: float | None, unknown: tuple[str, ...]
) -> None:
    """Add the part of an entity's motion that an action defines.

    Args:
        path: for messages.
        name: of the entity.
        action: of the library.
        xosc: the library.
        way: is added to.
        start_s: start time; None if it is known only in simulation.
        unknown: conditions that decide about the start then.
    """
    word = type(action).__name__
    if isinstance(action, xosc.ControllerAction):
        way.controller = way.controller or _controller(action)
        return
    if isinstance(action, xosc.ActivateControllerAction):
        way.controller = way.controller or (word if action.lateral or action.longitudinal else "")
        return
    if word in _WITHOUT_MOTION:
        return
    if isinstance(action, xosc.FollowTrajectoryAction):
        way.trajectories.append(TrajectoryAction(action, start_s, unknown))
        return
    if isinstance(action, xosc.TeleportAction) and start_s == 0.0:
        raise TrajectoryError(f"{path}: {name!r} is placed by a TeleportAction of a story; location it in Init")
    change = _speed(action, start_s or 0.0, xosc) or _lane(path, name, action, start_s or 0.0, xosc)
    if change is None:
        raise TrajectoryError(f"{path}: {name!r} does a {word}, whose motion is known only in simulation: {REMEDY}")
    if start_s is None:
        raise TrajectoryError(
            f"{path}: a {word} of {name!r} starts when a traffic condition is met ({', '.join(unknown)}), at a time "
            f"that is known only in simulation: {REMEDY}"
        )
    if isinstance(change, SpeedAction):
        way.speeds.append(change)
    else:
        way.lanes.append(change)


def _controller(action: Any) -> str:
    """Name of a controller that an action assigns and activates; empty if it does not."""
    assigned, activated = action.assignControllerAction, action.activateControllerAction
    if assigned is not None and (assigned.activateLateral or assigned.activateLongitudinal):
        controller = assigned.controller
        return str(getattr(controller, "name", None) or getattr(controller, "entryname", None) or "a controller")
    if activated is not None and (activated.lateral or activated.longitudinal):
        return "ActivateControllerAction"
    return ""


def _transition(dynamics: Any) -> Transition:
    return Transition(dynamics.shape.get_name(), dynamics.dimension.get_name(), float(dynamics.value))


def _speed(action: Any, start_s: float, xosc: Any) -> SpeedAction | None:
    """A speed action; None for others."""
    if isinstance(action, xosc.AbsoluteSpeedAction):
        return SpeedAction(start_s, float(action.speed), _transition(action.transition_dynamics))
    if isinstance(action, xosc.RelativeSpeedAction):
        transition = _transition(action.transition_dynamics)
        is_factor = action.valuetype.get_name() == "factor"
        return SpeedAction(start_s, float(action.speed), transition, action.entity, is_factor, bool(action.continuous))
    return None


def _lane(path: Path, name: str, action: Any, start_s: float, xosc: Any) -> LaneAction | None:
    """A lane change, or a change of the offset in the lane; None for other actions."""
    if isinstance(action, xosc.AbsoluteLaneOffsetAction):
        shape = action.dynshape.get_name()
        if shape != "step" and not action.maxlatacc:
            raise TrajectoryError(
                f"{path}: a LaneOffsetAction of {name!r} has no maxLateralAcc, so its duration is up to the simulator: "
                f"{REMEDY}"
            )
        transition = Transition(shape, "acceleration", float(action.maxlatacc or 0.0))
        return LaneAction(start_s, None, "", float(action.value), transition)
    if isinstance(action, xosc.AbsoluteLaneChangeAction | xosc.RelativeLaneChangeAction):
        reference = action.target if isinstance(action, xosc.RelativeLaneChangeAction) else ""
        offset_m = float(action.target_lane_offset or 0.0)
        return LaneAction(start_s, int(action.lane), reference, offset_m, _transition(action.transition_dynamics))
    return None


def _first_time_s(trigger: Any, xosc: Any) -> float | None:
    """Time at which a trigger fires [s]; None if that depends on more than simulation time.

    A trigger fires when all conditions of one of its groups are met. Without conditions it fires at once.
    """
    groups = _condition_groups(trigger, xosc)
    times = [_group_time_s(group, xosc) for group in groups]
    if not times:
        return 0.0
    return None if None in times else min(time for time in times if time is not None)


def _unknown_conditions(trigger: Any, xosc: Any) -> list[str]:
    """Names of a trigger's conditions whose time is known only in simulation."""
    conditions = [condition for group in _condition_groups(trigger, xosc) for condition in group]
    return [_condition_word(condition) for condition in conditions if _condition_time_s(condition, xosc) is None]


def _condition_groups(trigger: Any, xosc: Any) -> list[list[Any]]:
    """Conditions of a trigger's groups."""
    if trigger is None:
        return []
    if isinstance(trigger, xosc.ValueTrigger | xosc.EntityTrigger):
        return [[trigger]]
    groups = getattr(trigger, "conditiongroups", None)
    if groups is not None:
        return [list(group.conditions) for group in groups if group.conditions]
    conditions = getattr(trigger, "conditions", None)
    return [list(conditions)] if conditions else []


def _group_time_s(group: list[Any], xosc: Any) -> float | None:
    times = [_condition_time_s(condition, xosc) for condition in group]
    return None if None in times else max(time for time in times if time is not None)


def _condition_time_s(condition: Any, xosc: Any) -> float | None:
    value: Any = getattr(condition, "valuecondition", None)
    if not isinstance(value, xosc.SimulationTimeCondition) or value.rule.get_name() not in _AFTER:
        return None
    return max(float(value.value), 0.0) + float(condition.delay or 0.0)


def _condition_word(condition: Any) -> str:
    part = getattr(condition, "valuecondition", None) or getattr(condition, "entitycondition", None) or condition
    return type(part).__name__
