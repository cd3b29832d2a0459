"""What each driver is like, drawn once by his vehicle's id, so that nobody's draw depends on another's."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from cosim.traffic.behaviour.config import BehaviourConfig


@dataclass(frozen=True)
class Habits:
    """One driver.

    Attributes:
        over_mps, over_share: how much he exceeds limits on free roads.
        gap_m, headway_s: to the leader.
        lane_offset_m: beside the lane's middle, positive to the left.
        changes_left, changes_right: chance of a change on a stretch of road with a lane there.
        imperfection: SUMO's sigma; None: as his vehicle type has it.
        reaction_s: between two decisions; None: he decides in every step.
    """

    over_mps: float
    over_share: float
    gap_m: float
    headway_s: float
    lane_offset_m: float
    changes_left: float
    changes_right: float
    imperfection: float | None = None
    reaction_s: float | None = None

    def speed_factor(self, limit_mps: float) -> float:
        """Share of a limit he wants to drive."""
        return 1.0 + self.over_share + self.over_mps / max(limit_mps, 1.0)


def draw_habits(config: BehaviourConfig, seed: int, vehicle: str) -> Habits:
    """The habits of a vehicle's driver."""
    rng = np.random.default_rng([seed, zlib.crc32(vehicle.encode())])
    return Habits(
        over_mps=config.speeding_kmh.draw(rng) / 3.6,
        over_share=config.speeding_share.draw(rng),
        gap_m=config.gap_m.draw(rng),
        headway_s=config.headway_s.draw(rng),
        lane_offset_m=config.lane_offset_m.draw(rng),
        changes_left=config.lane_change_share.draw(rng),
        changes_right=config.lane_change_share.draw(rng),
        imperfection=None if config.imperfection is None else config.imperfection.draw(rng),
        reaction_s=None if config.reaction_time_s is None else config.reaction_time_s.draw(rng),
    )
