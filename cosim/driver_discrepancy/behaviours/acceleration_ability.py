"""Acceleration: the largest that drivers use."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, town: Background) -> dict[str, float]:
    own = config.acceleration_mps2
    return {"accel_mps2": town.accel_mps2 if own is None else moments(own)[0]}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, acceleration_mps2=even(values["accel_mps2"], 0, 0.2, 10))


ACCELERATION_ABILITY = Behaviour(
    "acceleration_ability",
    (Knob("accel_mps2", "m/s²", 0.4, 6.0, -0.6, "largest acceleration"),),
    ("acceleration",),
    "dv/dt ≤ accel",
    "accel",
    ("imperfection", "startup_delay"),
    _read,
    _write,
    condition="class",
)
