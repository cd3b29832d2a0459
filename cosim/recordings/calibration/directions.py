"""Accuracy of beam directions: angles between directions estimated from independent parts of a recording.

The metric of NVIDIA NCore: the mean and the largest angle between true and estimated ray; where the truth is not known,
between two estimates from different scans.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams, in_order
from sensors.effects.base import BeamEffect, Effect
from sensors.pattern import Pattern
from sensors.shot import Shot

_STEPS = 64
_SAME_DEG = 0.2


@dataclass(frozen=True)
class DirectionError:
    """Angles between the beams of two estimates [°].

    Attributes:
        mean_deg, max_deg: over lasers and azimuths.
        lasers: that both have.
        by_elevation_deg: mean absolute difference of the elevations that cones show.
    """

    mean_deg: float
    max_deg: float
    lasers: int
    by_elevation_deg: float

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def direction_error(
    first: Pattern, second: Pattern, effects: Sequence[Effect] = (), others: Sequence[Effect] = ()
) -> DirectionError | None:
    """Angles between the true beams of two estimates of one sensor; None where they have no laser in common.

    Args:
        first, second: patterns.
        effects, others: of the sensor in the first and in the second estimate; those that turn beams count.
    """
    one, other = (np.array(pattern.elevation_deg) for pattern in (first, second))
    nearest = np.abs(one[:, None] - other).argmin(1)
    rows = np.flatnonzero(np.abs(one - other[nearest]) < _SAME_DEG)
    if not len(rows):
        return None
    left, right = _directions(first, effects)[rows], _directions(second, others)[nearest[rows]]
    angle = np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(left - right, axis=-1) / 2, 0, 1)))
    apart = float(np.abs(one[rows] - other[nearest[rows]]).mean())
    return DirectionError(float(angle.mean()), float(angle.max()), len(rows), apart)


def _directions(pattern: Pattern, effects: Sequence[Effect]) -> np.ndarray:
    """True directions (k, 64, 3) float64 of the lasers, without their azimuth offsets, at evenly spaced azimuths.

    Errors that depend on the surface that a beam meets are none of the sensor's directions, and are left out.
    """
    even = pattern.model_copy(update={"firings": _STEPS, "azimuth_offset_deg": (0.0,) * pattern.rings})
    rays = even.rays()
    turning = [
        one
        for one in in_order(effects)
        if isinstance(one, BeamEffect) and one.channel != "pose" and not one.needs_surfaces
    ]
    shot = Shot(even, rays)
    beams = act_on_beams(turning, Beams.nominal(rays), shot, Streams(np.random.default_rng(0)), "directions")
    return beams.direction.astype(float).reshape(pattern.rings, _STEPS, 3)
