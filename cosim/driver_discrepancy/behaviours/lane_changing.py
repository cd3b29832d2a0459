"""Lane changes without a reason."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, _: Background) -> dict[str, float]:
    return {"share": moments(config.lane_change_share)[0]}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    return changed_in(config, lane_change_share=even(values["share"], 0, 0, 1))


LANE_CHANGING = Behaviour(
    "lane_changing",
    (Knob("share", "", 0.0, 1.0, 0.35, "probability of a change to a side, per stretch of road with a lane there"),),
    ("lane_changes_other", "lane_changes_right"),
    "changes of lane without a reason, with a probability per road",
    "changeLane; lcSpeedGain, lcSigma",
    (),
    _read,
    _write,
    is_incident=True,
)
