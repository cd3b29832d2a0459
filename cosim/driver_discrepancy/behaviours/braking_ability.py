"""Braking: the deceleration that drivers plan with."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, town: Background) -> dict[str, float]:
    own = config.braking_mps2
    return {"decel_mps2": town.decel_mps2 if own is None else moments(own)[0]}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, braking_mps2=even(values["decel_mps2"], 0, 0.5, 12))


BRAKING_ABILITY = Behaviour(
    "braking_ability",
    (Knob("decel_mps2", "m/s²", 1.0, 9.0, -1.0, "usual largest deceleration"),),
    ("deceleration",),
    "safe speed from v²/(2·decel)",
    "decel",
    ("short_gap",),
    _read,
    _write,
    condition="class",
)
