"""Start-up delay: time that a standing driver takes before setting off."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, town: Background) -> dict[str, float]:
    own = config.startup_delay_s
    return {"delay_s": town.startup_delay_s if own is None else moments(own)[0]}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, startup_delay_s=even(values["delay_s"], 0, 0, 10))


STARTUP_DELAY = Behaviour(
    "startup_delay",
    (Knob("delay_s", "s", 0.0, 5.0, 0.6, "time before a standing driver sets off"),),
    ("startup_lag",),
    "sets off delay after the way is free",
    "startupDelay",
    ("reaction_time", "acceleration_ability"),
    _read,
    _write,
)
