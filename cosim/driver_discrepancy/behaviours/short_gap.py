"""Distances kept: gap at rest and time headway when following."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Values, changed_in, even, moments
from cosim.traffic.behaviour import BehaviourConfig


def _read(config: BehaviourConfig, town: Background) -> dict[str, float]:
    gap = town.min_gap_m if config.gap_m is None else moments(config.gap_m)[0]
    tau = town.tau_s if config.headway_s is None else moments(config.headway_s)[0]
    return {"min_gap_m": gap, "tau_s": tau}


def _write(config: BehaviourConfig, values: Values) -> BehaviourConfig:
    (gap, gap_dev), (tau, tau_dev) = moments(config.gap_m), moments(config.headway_s)
    gap_dev *= min(values["min_gap_m"] / max(gap, 0.1), 2.0)
    tau_dev *= min(values["tau_s"] / max(tau, 0.1), 2.0)
    return changed_in(
        config,
        gap_m=even(values["min_gap_m"], gap_dev, 0.05, 20),
        headway_s=even(values["tau_s"], tau_dev, 0.3, 5),
    )


SHORT_GAP = Behaviour(
    "short_gap",
    (
        Knob("min_gap_m", "m", 0.1, 8.0, -0.8, "mean gap to the leader when standing"),
        Knob("tau_s", "s", 0.35, 4.0, -0.3, "mean headway to the leader when driving"),
    ),
    ("standing_gap", "headway"),
    "gap = min_gap + tau·v",
    "minGap, tau",
    ("reaction_time",),
    _read,
    _write,
)
