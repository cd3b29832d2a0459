"""Reflectances of ground and objects, estimated from measured intensities because labels do not contain them.

Each reflectance is a mean over many lasers, ranges and incidence angles. The sensor model therefore still has to
explain how intensity depends on laser, range and incidence angle, but not its level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.drives.twin import Instance
from cosim.drives.twin.trust import Trust, in_box

_MIN_POINTS = 30  # for an estimate of an object's paint
_DEFAULT_SPREAD = 0.2  # standard deviation of the intensity for objects with fewer points


@dataclass(frozen=True)
class Brightness:
    """Mean intensity (0–1), number and standard deviation of measured points."""

    mean: float
    points: int
    spread: float = 0.0

    @classmethod
    def of(cls, intensity: np.ndarray) -> Brightness:
        """Compute it from intensities (n,)."""
        if not len(intensity):
            return cls(0.0, 0)
        values = intensity.clip(0, 1).astype(np.float64)
        return cls(float(values.mean()), len(values), float(values.std()))


def ground_brightness(trust: Trust, xyz: np.ndarray, intensity: np.ndarray) -> Brightness:
    """Brightness of the points (n, 3), world axes, that are on trusted ground."""
    return Brightness.of(intensity[trust.measured(xyz, ())])


def estimate_paint(
    instances: Sequence[Instance], xyz: np.ndarray, intensity: np.ndarray
) -> tuple[tuple[Instance, ...], np.ndarray]:
    """Set the paint of each instance to the mean intensity of the points (n, 3) in its box, if there are enough.

    Returns:
        The instances and the standard deviations (i,) of the intensities in their boxes.
    """
    painted, spread = [], np.full(len(instances), _DEFAULT_SPREAD)
    for row, instance in enumerate(instances):
        brightness = Brightness.of(intensity[in_box(xyz, instance, 0.0)])
        has_points = brightness.points >= _MIN_POINTS
        painted.append(replace(instance, paint=brightness.mean) if has_points else instance)
        spread[row] = brightness.spread if has_points else _DEFAULT_SPREAD
    return tuple(painted), spread
