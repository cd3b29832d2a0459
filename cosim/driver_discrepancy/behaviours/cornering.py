"""Cornering speed: the lateral acceleration that drivers accept in bends."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in
from cosim.traffic.behaviour import BehaviourConfig

_AS_THE_NETWORK_MPS2 = 6.0  # lanes of SUMO's networks are limited to 5.5 m/s² in bends


def _read(config: BehaviourConfig, _: Background) -> dict[str, float]:
    own = config.cornering_mps2
    return {"lateral_mps2": _AS_THE_NETWORK_MPS2 if own is None else own}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, cornering_mps2=values["lateral_mps2"])


CORNERING = Behaviour(
    "cornering",
    (Knob("lateral_mps2", "m/s²", 0.5, 6.0, -2.5, "accepted lateral acceleration in bends"),),
    ("bend_speed",),
    "v ≤ √(a_lat·R) in bends",
    "speed of lanes in bends",
    (),
    _read,
    _write,
)
