"""Desired speed: drivers want to go a multiple of the limit that differs between them."""

from __future__ import annotations

import numpy as np

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig

_USUAL_LIMIT_MPS = 13.9


def _read(config: BehaviourConfig, town: Background) -> dict[str, float]:
    over, other = moments(config.speeding_kmh)
    if config.speeding_share is None:
        mean, deviation = town.speed_factor, town.speed_dev
    else:
        share, deviation = moments(config.speeding_share)
        mean = 1 + share
    deviation = float(np.hypot(deviation, other / 3.6 / _USUAL_LIMIT_MPS))
    return {"speed_factor": mean + over / 3.6 / _USUAL_LIMIT_MPS, "speed_dev": deviation}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    share = even(values["speed_factor"] - 1, values["speed_dev"], -0.5, 1.0)
    return changed_in(config, speeding_share=share, speeding_kmh=even(0, 0, 0, 0))


SPEEDING = Behaviour(
    "speeding",
    (
        Knob("speed_factor", "", 0.6, 1.9, 0.15, "mean share of the limit that drivers want to go"),
        Knob("speed_dev", "", 0.0, 0.4, 0.06, "its standard deviation between drivers"),
    ),
    ("free_speed", "free_speed_spread", "slow_drivers", "fast_drivers"),
    "v_free = f·limit, f differs between drivers",
    "speedFactor, speedDev",
    ("driver_classes", "street_speed"),
    _read,
    _write,
)
