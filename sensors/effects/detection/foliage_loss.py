"""Leaves split a beam into echoes that are too weak to be detected."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import DetectionEffect, number
from sensors.effects.material_groups import rows_of_group
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class FoliageLoss(DetectionEffect):
    """Each return of vegetation is lost with probability share·R/(R + R₀): wide beams are shared by many leaves."""

    name: ClassVar = "foliage_loss"
    phase: ClassVar = Phase.DROPOUT
    channel: ClassVar = "drop"
    equation: ClassVar = "P(lost) = share·R/(R + R₀) on vegetation"
    reference: ClassVar = (
        "Ross: The Radiation Regime and Architecture of Plant Stands, 1981; lost firings of KITTI's scans"
    )
    taxonomy: ClassVar = "di1"
    confusable_with: ClassVar = ("random_dropout", "path_dropout")
    example: ClassVar = {"share": 0.1, "range_m": 10.0}
    is_candidate: ClassVar = False

    share: float = number("share that is lost far away", ge=0, le=1)
    range_m: float = number("R₀, range at which half of that is lost", unit="m", ge=0.1, le=200)

    def kept(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability (m,) of each return; below 1 on vegetation, decreasing with range."""
        kept = np.ones(len(returns))
        rows = rows_of_group("vegetation", returns, shot)
        range_m = returns.range_m[rows].astype(np.float64)
        kept[rows] -= self.share * range_m / (range_m + self.range_m)
        return kept
