"""Parked vehicles that leave the kerb."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, _: Background) -> dict[str, float]:
    return {"per_min": config.pull_outs_per_min}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, pull_outs_per_min=values["per_min"])


PARKED_PULL_OUT = Behaviour(
    "parked_pull_out",
    (Knob("per_min", "1/min", 0.0, 60.0, 4.0, "parked vehicles that drive off in the town per minute"),),
    ("pull_outs",),
    "a parked vehicle leaves the kerb",
    "stop parkingArea, resume",
    (),
    _read,
    _write,
    is_incident=True,
)
