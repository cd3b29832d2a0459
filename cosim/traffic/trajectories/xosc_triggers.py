"""Start and stop times of OpenSCENARIO triggers that depend only on simulation time."""

from __future__ import annotations

from typing import Any

_AFTER = ("greaterThan", "greaterOrEqual", "equalTo")


def first_time_s(trigger: Any, xosc: Any) -> float | None:
    """Time at which a trigger fires [s]; None if that depends on more than simulation time.

    A trigger fires when all conditions of one of its groups are met. Without conditions it fires at once.
    """
    groups = _groups(trigger, xosc)
    times = [_group_time_s(group, xosc) for group in groups]
    if not times:
        return 0.0
    return None if None in times else min(time for time in times if time is not None)


def unknown_conditions(trigger: Any, xosc: Any) -> list[str]:
    """Names of a trigger's conditions whose time is known only in simulation."""
    conditions = [condition for group in _groups(trigger, xosc) for condition in group]
    return [_word(condition) for condition in conditions if _time_s(condition, xosc) is None]


def _groups(trigger: Any, xosc: Any) -> list[list[Any]]:
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
    times = [_time_s(condition, xosc) for condition in group]
    return None if None in times else max(time for time in times if time is not None)


def _time_s(condition: Any, xosc: Any) -> float | None:
    value: Any = getattr(condition, "valuecondition", None)
    if not isinstance(value, xosc.SimulationTimeCondition) or value.rule.get_name() not in _AFTER:
        return None
    return max(float(value.value), 0.0) + float(condition.delay or 0.0)


def _word(condition: Any) -> str:
    part = getattr(condition, "valuecondition", None) or getattr(condition, "entitycondition", None) or condition
    return type(part).__name__
