"""Imperfection: random deceleration in every step (Krauß)."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, town: Background) -> dict[str, float]:
    own = config.imperfection
    return {"sigma": town.sigma if own is None else moments(own)[0]}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, imperfection=even(values["sigma"], 0, 0, 1))


IMPERFECTION = Behaviour(
    "imperfection",
    (Knob("sigma", "", 0.0, 1.0, 0.3, "driver imperfection of SUMO's Krauß model"),),
    ("unsteadiness", "jerk", "acceleration_memory"),
    "v − sigma·accel·dt·U(0,1) in every step (Krauß)",
    "sigma",
    ("reaction_time", "acceleration_ability"),
    _read,
    _write,
)
