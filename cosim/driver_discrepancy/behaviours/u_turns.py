"""U-turns in the road."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, _: Background) -> dict[str, float]:
    return {"per_min": config.u_turns_per_min}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, u_turns_per_min=values["per_min"])


U_TURNS = Behaviour(
    "u_turns",
    (Knob("per_min", "1/min", 0.0, 60.0, 4.0, "U-turns per minute in the whole town"),),
    ("u_turns",),
    "a driver turns round where he could have gone on",
    "changeTarget to the reverse edge",
    (),
    _read,
    _write,
    is_incident=True,
)
