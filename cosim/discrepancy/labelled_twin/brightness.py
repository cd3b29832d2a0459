"""How bright what the labels name is: reflectances are not in labels, so the twin's are those that were measured.

A mean over many lasers, ranges and slants: what is left to the sensor's model is how intensities differ from laser to
laser, with range and with slant, not their level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.labelled_twin.trust import Trust, in_box
from cosim.twin import Instance

_FEWEST = 30  # points that tell a paint


@dataclass(frozen=True)
class Brightness:
    """Mean measured intensity of some points, 0–1, and how many they are."""

    mean: float
    points: int

    @classmethod
    def of(cls, intensity: np.ndarray) -> Brightness:
        """That of intensities (n,)."""
        return cls(float(np.mean(intensity.clip(0, 1), dtype=np.float64)) if len(intensity) else 0.0, len(intensity))


def ground_brightness(trust: Trust, xyz: np.ndarray, intensity: np.ndarray) -> Brightness:
    """That of returns (n, 3), world axes, which are of trusted ground."""
    return Brightness.of(intensity[trust.measured(xyz, ())])


def painted(instances: Sequence[Instance], xyz: np.ndarray, intensity: np.ndarray) -> tuple[Instance, ...]:
    """Instances as bright as the returns (n, 3) in their boxes, where these are enough to tell."""
    found = []
    for instance in instances:
        seen = Brightness.of(intensity[in_box(xyz, instance, 0.0)])
        found.append(replace(instance, paint=seen.mean) if seen.points >= _FEWEST else instance)
    return tuple(found)
