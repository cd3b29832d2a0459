"""Channels of driving behaviour: each gives values at samples or events, whose weighted mean is the statistic.

All statistics are ratios of sums, so that they can be restricted to a street, a time or a class of vehicles, and
attributed to single vehicles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.driver_discrepancy.junctions import measure_junctions
from cosim.driver_discrepancy.lane_use import measure_lanes
from cosim.driver_discrepancy.motion import MOTION
from cosim.driver_discrepancy.placed import Placed
from cosim.driver_discrepancy.values import Values

_FAST, _SLOW = 1.12, 0.88  # limits of the shares of fast and slow drivers, of the mean free speed


@dataclass(frozen=True)
class Channel:
    """A channel.

    Attributes:
        group: the channel of the error that it belongs to.
        unit: of its values.
        scale: difference that counts one in the error.
        resolution: differences so small are not attributed to drivers.
        words: description on pages.
        is_event: counted by vehicle in the error, instead of averaged.
        is_act: events are decisions of single drivers; others have a common cause, such as the stops in a queue.
    """

    group: str
    unit: str
    scale: float
    resolution: float
    words: str
    is_event: bool = False
    is_act: bool = False


CHANNELS: dict[str, Channel] = {
    "speed": Channel("speed", "of the limit", 0.1, 0.01, "speed when moving"),
    "free_speed": Channel("speed", "of the limit", 0.05, 0.01, "speed without a leader"),
    "free_speed_spread": Channel(
        "speed", "of the limit²", 0.005, 0.001, "spread of the free speed between drivers, about the measured mean"
    ),
    "slow_drivers": Channel("speed", "", 0.2, 0.02, "share of drivers far below the measured mean free speed"),
    "fast_drivers": Channel("speed", "", 0.2, 0.02, "share of drivers far above the measured mean free speed"),
    "bend_speed": Channel("speed", "m/s", 0.5, 0.12, "speed in bends"),
    "acceleration": Channel("acceleration", "m/s²", 0.2, 0.05, "acceleration on a free road"),
    "deceleration": Channel("deceleration", "m/s²", 0.3, 0.08, "deceleration when braking"),
    "jerk": Channel("jerk", "m/s³", 1.0, 0.15, "change of the acceleration"),
    "unsteadiness": Channel("jerk", "m/s²", 0.2, 0.04, "change of the acceleration when cruising"),
    "headway": Channel("headway", "s", 0.3, 0.06, "net time headway (time gap) when following"),
    "space_headway": Channel("headway", "m", 3.0, 0.5, "net distance to the leader"),
    "standing_gap": Channel("standing_gap", "m", 0.3, 0.08, "gap to the leader in a queue"),
    "startup_lag": Channel("startup_lag", "s", 0.4, 0.1, "delay behind the leader when a queue starts"),
    "acceleration_memory": Channel("reaction", "", 0.2, 0.03, "acceleration left after 0.4 s"),
    "acceleration_memory_1s": Channel("reaction", "", 0.2, 0.03, "acceleration left after 1 s"),
    "follower_response": Channel("reaction", "", 0.3, 0.08, "response to the leader's acceleration after 1 s"),
    "decisions": Channel("reaction", "", 0.2, 0.004, "share of time steps with a new acceleration"),
    "lateral": Channel("lateral", "m", 0.05, 0.012, "lateral position in the lane, to the left"),
    "lateral_spread": Channel(
        "lateral", "m²", 0.005, 0.001, "spread of the lateral position between drivers, about the measured mean"
    ),
    "lateral_motion": Channel("lateral", "m/s", 0.05, 0.01, "lateral speed in the lane"),
    "lane_changes_speed": Channel("lane_changes", "/min", 0.3, 0.1, "lane changes past a slow leader", True, True),
    "lane_changes_right": Channel("lane_changes", "/min", 0.3, 0.1, "lane changes to the right", True, True),
    "lane_changes_route": Channel("lane_changes", "/min", 0.3, 0.1, "lane changes before a turn", True, True),
    "lane_changes_other": Channel("lane_changes", "/min", 0.3, 0.1, "lane changes without a reason", True, True),
    "lane_use": Channel("lane_changes", "", 0.2, 0.02, "share of time left of the right lane"),
    "accepted_gap": Channel("gap_acceptance", "s", 1.0, 0.2, "accepted gap in the major stream, 10 s at most"),
    "rejected_gap": Channel("gap_acceptance", "s", 1.0, 0.2, "rejected gap in the major stream, 10 s at most"),
    "yielding": Channel("gap_acceptance", "", 0.2, 0.02, "share of time standing before a junction without priority"),
    "u_turns": Channel("u_turns", "/h", 0.3, 0.0, "U-turns", True, True),
    "pull_outs": Channel("pull_outs", "/h", 0.3, 0.0, "pull-outs of parked vehicles", True, True),
    "stops": Channel("stops", "/min", 0.5, 0.1, "stops", True),
    "standing": Channel("stops", "", 0.1, 0.015, "share of time standing"),
    "red_entries": Channel("signals", "/entry", 0.1, 0.02, "vehicles that enter a junction at red", True, True),
    "counts": Channel("counts", "/vehicle", 1.0, 0.02, "streets entered", True),
    "left_turns": Channel("counts", "", 0.3, 0.02, "share of left turns"),
    "right_turns": Channel("counts", "", 0.3, 0.02, "share of right turns"),
}
"""The dictionary's channels."""


def measure_channels(
    placed: Placed, red: np.ndarray, planned: frozenset[tuple[str, str]] = frozenset()
) -> dict[str, Values]:
    """Values of all channels that are sampled; those about differences between drivers follow from vehicles' means.

    Args:
        placed: trajectories on their network.
        red: (n,) whether the link ahead shows red; from `signals`.
        planned: vehicle and edge of U-turns that are part of the demand and not counted.
    """
    found = {name: function(placed) for name, function in MOTION.items()}
    return found | measure_lanes(placed) | measure_junctions(placed, red, planned)


def between_drivers(name: str, sums: np.ndarray, weights: np.ndarray, centre: float) -> tuple[np.ndarray, np.ndarray]:
    """A channel about differences between drivers, from the sums and weights (v,) of its base channel.

    Args:
        name: `free_speed_spread`, `slow_drivers`, `fast_drivers` or `lateral_spread`.
        sums, weights: of `BASES[name]`.
        centre: mean over measured drivers, about which differences are counted.
    """
    counts = weights > 0
    mean = np.divide(sums, weights, out=np.full(len(sums), centre), where=counts)
    value = {
        "free_speed_spread": np.minimum((mean - centre) ** 2, 0.25),
        "lateral_spread": np.minimum((mean - centre) ** 2, 0.25),
        "slow_drivers": (mean < _SLOW * centre).astype(float),
        "fast_drivers": (mean > _FAST * centre).astype(float),
    }[name]
    return np.where(counts, value, 0.0), counts.astype(float)


BASES = {
    "free_speed_spread": "free_speed",
    "slow_drivers": "free_speed",
    "fast_drivers": "free_speed",
    "lateral_spread": "lateral",
}
