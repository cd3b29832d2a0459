"""Speed by street: streets on which all vehicles drive slower or faster."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Signal, Values, changed_in
from cosim.traffic.behaviour import BehaviourConfig

_FIRST_Z, _OTHERS_Z = 3.0, 1.2
_SIMILAR = 0.4  # of the clearest street's change (logarithm), that a street must have to belong to it
_BEGINS = 0.05  # initial change of the factor in a fit


def _read(config: BehaviourConfig, _: Background) -> dict[str, float]:
    return {"factor": 1.0 if config.street_speed is None else config.street_speed.factor}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    if config.street_speed is None:
        return config
    return changed_in(config, street_speed={"edges": config.street_speed.edges, "factor": values["factor"]})


def _propose(config: BehaviourConfig, signals: Sequence[Signal]) -> BehaviourConfig | None:
    """The streets whose speeds differ most, all in the same direction."""
    best: dict[str, Signal] = {}
    for signal in signals:
        if signal.condition == "street" and signal.channel in ("free_speed", "speed") and signal.ratio > 0:
            known = best.get(signal.level)
            best[signal.level] = signal if known is None or abs(signal.z) > abs(known.z) else known
    first = max(best.values(), key=lambda signal: abs(signal.z), default=None)
    if first is None or abs(first.z) < _FIRST_Z:
        return None
    change = np.log(first.ratio)
    edges = tuple(
        sorted(
            edge
            for edge, signal in best.items()
            if signal.z * first.z > 0 and abs(signal.z) > _OTHERS_Z and np.log(signal.ratio) / change > _SIMILAR
        )
    )
    if len(edges) > len(best) / 2:
        return None
    return changed_in(config, street_speed={"edges": edges, "factor": 1 + _BEGINS * (1 if first.z > 0 else -1)})


STREET_SPEED = Behaviour(
    "street_speed",
    (Knob("factor", "", 0.2, 2.0, -0.15, "factor of the limits of the streets concerned"),),
    ("free_speed", "speed"),
    "v_free = f·factor·limit on some streets",
    "speed of lanes",
    ("speeding",),
    _read,
    _write,
    condition="street",
    propose=_propose,
)
