"""Lateral offset from the lane's centre line."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, _: Background) -> dict[str, float]:
    mean, deviation = moments(config.lane_offset_m)
    return {"lat_alignment_m": mean, "lat_dev_m": deviation}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, lane_offset_m=even(values["lat_alignment_m"], values["lat_dev_m"], -0.3, 0.3))


LANE_OFFSET = Behaviour(
    "lane_offset",
    (
        Knob("lat_alignment_m", "m", -0.3, 0.3, 0.15, "mean lateral position in the lane, to the left"),
        Knob("lat_dev_m", "m", 0.0, 0.18, 0.08, "its standard deviation between drivers"),
    ),
    ("lateral", "lateral_spread"),
    "y = offset, constant for a driver",
    "latAlignment",
    (),
    _read,
    _write,
)
