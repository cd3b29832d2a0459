"""Each laser loses its own share of returns."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import DetectionEffect, bounded, per_ring
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class LaserDropout(DetectionEffect):
    """Each return of laser i is lost with probability shares[i], independently."""

    name: ClassVar = "laser_dropout"
    phase: ClassVar = Phase.DROPOUT
    channel: ClassVar = "drop"
    equation: ClassVar = "P(lost) = shares[ring]"
    reference: ClassVar = "Velodyne HDL-64E S2 user's manual; single missing returns by laser in KITTI's scans"
    taxonomy: ClassVar = "di1"
    confusable_with: ClassVar = ("random_dropout", "path_dropout")
    example: ClassVar = {"shares": (0.02, 0.1) * 32}
    neutral: ClassVar = {"shares": (0.0,) * 64}
    is_candidate: ClassVar = False

    shares: bounded(0, 1) = per_ring("share of its returns that each laser loses, ring 0 first")  # type: ignore[valid-type]

    def kept(self, returns: Returns, shot: Shot) -> np.ndarray:
        """(m,) probability, equal for all returns of a laser."""
        return 1 - np.array(self.shares)[shot.rays.ring[returns.beam]]
