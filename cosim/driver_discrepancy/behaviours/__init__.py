"""The driver behaviours of the loop's catalogue, one file each."""

from __future__ import annotations

from cosim.driver_discrepancy.behaviours.acceleration_ability import ACCELERATION_ABILITY
from cosim.driver_discrepancy.behaviours.base import Background, Behaviour, Knob, Signal, with_common_luck
from cosim.driver_discrepancy.behaviours.braking_ability import BRAKING_ABILITY
from cosim.driver_discrepancy.behaviours.cornering import CORNERING
from cosim.driver_discrepancy.behaviours.driver_classes import DRIVER_CLASSES
from cosim.driver_discrepancy.behaviours.gap_acceptance import GAP_ACCEPTANCE
from cosim.driver_discrepancy.behaviours.imperfection import IMPERFECTION
from cosim.driver_discrepancy.behaviours.lane_changing import LANE_CHANGING
from cosim.driver_discrepancy.behaviours.lane_offset import LANE_OFFSET
from cosim.driver_discrepancy.behaviours.parked_pull_out import PARKED_PULL_OUT
from cosim.driver_discrepancy.behaviours.reaction_time import REACTION_TIME
from cosim.driver_discrepancy.behaviours.short_gap import SHORT_GAP
from cosim.driver_discrepancy.behaviours.speeding import SPEEDING
from cosim.driver_discrepancy.behaviours.startup_delay import STARTUP_DELAY
from cosim.driver_discrepancy.behaviours.street_speed import STREET_SPEED
from cosim.driver_discrepancy.behaviours.u_turns import U_TURNS

__all__ = ["BEHAVIOURS", "Background", "Behaviour", "Knob", "Signal", "with_common_luck"]

BEHAVIOURS: dict[str, Behaviour] = {
    behaviour.name: behaviour
    for behaviour in (
        SPEEDING,
        DRIVER_CLASSES,
        STREET_SPEED,
        CORNERING,
        SHORT_GAP,
        ACCELERATION_ABILITY,
        BRAKING_ABILITY,
        STARTUP_DELAY,
        GAP_ACCEPTANCE,
        LANE_OFFSET,
        LANE_CHANGING,
        U_TURNS,
        PARKED_PULL_OUT,
        IMPERFECTION,
        REACTION_TIME,
    )
}

TOGETHER = (
    (("speeding", "speed_factor"), ("parked_pull_out", "per_min")),
    (("gap_acceptance", "time_gap_s"), ("lane_offset", "lat_alignment_m")),
    (("speeding", "speed_dev"), ("lane_offset", "lat_dev_m"), ("lane_changing", "share"), ("startup_delay", "delay_s")),
    (("short_gap", "min_gap_m"), ("u_turns", "per_min"), ("cornering", "lateral_mps2")),
    (("short_gap", "tau_s"), ("imperfection", "sigma")),
    (("reaction_time", "action_step_s"),),
    (("acceleration_ability", "accel_mps2"),),
    (("braking_ability", "decel_mps2"),),
)
"""Groups of parameters that affect different channels, so that one simulation gives the derivatives of a group."""
