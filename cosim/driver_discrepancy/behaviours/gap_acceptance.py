"""Gap acceptance: the smallest time gap in the major stream that is used."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, town: Background) -> dict[str, float]:
    own = config.gap_acceptance_s
    return {"time_gap_s": town.time_gap_s if own is None else moments(own)[0]}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, gap_acceptance_s=even(values["time_gap_s"], 0, 0, 20))


GAP_ACCEPTANCE = Behaviour(
    "gap_acceptance",
    (Knob("time_gap_s", "s", 0.0, 8.0, 1.5, "smallest accepted time gap in the major stream"),),
    ("accepted_gap", "rejected_gap", "yielding", "standing"),
    "enters if the next vehicle with priority is later than time_gap",
    "jmTimegapMinor",
    (),
    _read,
    _write,
)
