"""Beams penetrate foliage and return from leaves inside."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import PointEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot

_LEAFY = ("foliage", "foliage_dark", "hedge")


class FoliageDepth(PointEffect):
    """On foliage R + s, s drawn from e^(−s/mean) up to the depth of the leaves: a beam's way before it meets one.

    The meshes of crowns and hedges are their outer leaves. A medium of leaf area density u, whose leaves turn any way,
    blocks a share u/2 of the remaining light on every metre, so that the mean depth is 2/u.
    """

    name: ClassVar = "foliage_depth"
    phase: ClassVar = Phase.FOLIAGE
    channel: ClassVar = "range"
    equation: ClassVar = "R + s on foliage, p(s) ∝ exp(−s/mean), 0 ≤ s ≤ most"
    reference: ClassVar = "Ross: The Radiation Regime and Architecture of Plant Stands, 1981, part I (G = 0.5)"
    confusable_with: ClassVar = ("range_noise", "beam_divergence", "surface_relief")
    example: ClassVar = {"mean_m": 0.3, "most_m": 1.0}
    neutral: ClassVar = {"mean_m": 0.0, "most_m": 1.0}

    mean_m: float = number("mean depth of an endless medium, 2 over its leaf area density", unit="m", ge=0, le=5)
    most_m: float = number("depth of the leaves; nothing returns from farther within", unit="m", ge=0.01, le=10)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns from inside foliage."""
        share = shot.per_return(returns, rng.random((2, len(shot.rays)), np.float32))
        if self.mean_m == 0:
            return returns
        names = shot.hits.table.names
        leafy = np.isin(returns.material, [row for row, name in enumerate(names) if name in _LEAFY])
        reach = -np.expm1(-self.most_m / self.mean_m)
        depth = (-self.mean_m * np.log1p(-share * reach)).astype(np.float32)
        return replace(returns, range_m=np.where(leafy, returns.range_m + depth, returns.range_m))
