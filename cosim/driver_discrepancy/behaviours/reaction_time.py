"""Reaction time: decisions at intervals, constant acceleration in between."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, town: Background) -> dict[str, float]:
    own = config.reaction_time_s
    return {"action_step_s": town.step_s if own is None else moments(own)[0]}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, reaction_time_s=even(values["action_step_s"], 0, 0, 3))


REACTION_TIME = Behaviour(
    "reaction_time",
    (Knob("action_step_s", "s", 0.0, 3.0, 0.6, "time between two decisions of a driver"),),
    ("decisions", "jerk", "unsteadiness", "acceleration_memory", "acceleration_memory_1s", "follower_response"),
    "decisions every action_step, the acceleration constant between",
    "actionStepLength",
    ("short_gap", "imperfection", "startup_delay"),
    _read,
    _write,
)
