"""Speed by street: streets on which everybody drives slower or faster."""

from __future__ import annotations

from collections.abc import Sequence

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Signal, Values, changed_in
from cosim.traffic.behaviour import BehaviourConfig

_FIRST_Z, _OTHERS_Z = 3.0, 2.0
_BEGINS = 0.05  # change of the factor from which a fit begins


def _read(config: BehaviourConfig, _: Background) -> dict[str, float]:
    return {"factor": 1.0 if config.street_speed is None else config.street_speed.factor}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    if config.street_speed is None:
        return config
    return changed_in(config, street_speed={"edges": config.street_speed.edges, "factor": values["factor"]})


def _propose(config: BehaviourConfig, signals: Sequence[Signal]) -> BehaviourConfig | None:
    """The streets whose speeds differ most, all in the same direction."""
    z: dict[str, float] = {}
    for signal in signals:
        if signal.condition == "street" and signal.channel in ("free_speed", "speed"):
            before = z.get(signal.level, 0.0)
            z[signal.level] = signal.z if abs(signal.z) > abs(before) else before
    first = max(z.values(), key=abs, default=0.0)
    if abs(first) < _FIRST_Z:
        return None
    edges = tuple(sorted(edge for edge, value in z.items() if value * first > 0 and abs(value) > _OTHERS_Z))
    if len(edges) > len(z) / 2:
        return None
    return changed_in(config, street_speed={"edges": edges, "factor": 1 + _BEGINS * (1 if first > 0 else -1)})


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
