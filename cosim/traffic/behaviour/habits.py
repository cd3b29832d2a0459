"""Characteristics of each driver, drawn from the vehicle's id, so that draws do not depend on other vehicles."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from cosim.traffic.behaviour.config import BehaviourConfig
from cosim.traffic.behaviour.distributions import Distribution


@dataclass(frozen=True)
class Habits:
    """Parameters of one driver; None means that of his vehicle type.

    Attributes:
        over_mps, over_share: desired speed less the limit [m/s] and [1]; the share is None for the type's speedFactor.
        gap_m, headway_s: to the leader.
        lane_offset_m: lateral position relative to the lane's middle, positive to the left.
        changes_left, changes_right: probability of a lane change on a stretch of road with a lane there.
        imperfection: SUMO's sigma.
        reaction_s: time between two decisions.
        accel_mps2, decel_mps2: largest acceleration and usual largest deceleration.
        startup_delay_s: time before a standing driver sets off.
        time_gap_s: smallest accepted gap in a major stream.
        speed_ratio: desired speed over that of the first class of drivers [1].
    """

    over_mps: float
    over_share: float | None
    gap_m: float | None
    headway_s: float | None
    lane_offset_m: float
    changes_left: float
    changes_right: float
    imperfection: float | None = None
    reaction_s: float | None = None
    accel_mps2: float | None = None
    decel_mps2: float | None = None
    startup_delay_s: float | None = None
    time_gap_s: float | None = None
    speed_ratio: float = 1.0

    def speed_factor(self, limit_mps: float, own: float = 1.0) -> float:
        """Share of a limit that the driver wants to drive.

        Args:
            limit_mps: the limit.
            own: the speed factor of his vehicle type, which counts where no share is configured.
        """
        base = own if self.over_share is None else 1.0 + self.over_share
        return (base + self.over_mps / max(limit_mps, 1.0)) * self.speed_ratio


def draw_habits(config: BehaviourConfig, seed: int, vehicle: str) -> Habits:
    """Draw the parameters of a vehicle's driver; a parameter that is not configured takes no draw."""
    key = zlib.crc32(vehicle.encode())
    rng, classes = np.random.default_rng([seed, key]), config.driver_classes
    second = classes is not None and float(np.random.default_rng([seed, key, 5]).random()) < classes.share

    def draw(distribution: Distribution | None) -> float | None:
        return None if distribution is None else distribution.draw(rng)

    return Habits(
        over_mps=config.speeding_kmh.draw(rng) / 3.6,
        over_share=draw(config.speeding_share),
        gap_m=draw(config.gap_m),
        headway_s=draw(config.headway_s),
        lane_offset_m=config.lane_offset_m.draw(rng),
        changes_left=config.lane_change_share.draw(rng),
        changes_right=config.lane_change_share.draw(rng),
        imperfection=draw(config.imperfection),
        reaction_s=draw(config.reaction_time_s),
        accel_mps2=draw(config.acceleration_mps2),
        decel_mps2=draw(config.braking_mps2),
        startup_delay_s=draw(config.startup_delay_s),
        time_gap_s=draw(config.gap_acceptance_s),
        speed_ratio=classes.speed_ratio if classes is not None and second else 1.0,
    )
