"""How bright what the labels name is: reflectances are not in labels, so the twin's are those that were measured.

A mean over many lasers, ranges and slants: what is left to the sensor's model is how intensities differ from laser to
laser, with range and with slant, not their level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.drives.twin import Instance
from cosim.drives.twin.trust import Trust, in_box

_FEWEST = 30  # points that tell a paint
_UNSEEN = 0.2  # spread of intensities of bodies with fewer


@dataclass(frozen=True)
class Brightness:
    """Mean measured intensity of some points, 0–1, how many they are, and how far they scatter."""

    mean: float
    points: int
    spread: float = 0.0

    @classmethod
    def of(cls, intensity: np.ndarray) -> Brightness:
        """That of intensities (n,)."""
        if not len(intensity):
            return cls(0.0, 0)
        bright = intensity.clip(0, 1).astype(np.float64)
        return cls(float(bright.mean()), len(bright), float(bright.std()))


def ground_brightness(trust: Trust, xyz: np.ndarray, intensity: np.ndarray) -> Brightness:
    """That of returns (n, 3), world axes, which are of trusted ground."""
    return Brightness.of(intensity[trust.measured(xyz, ())])


def painted(
    instances: Sequence[Instance], xyz: np.ndarray, intensity: np.ndarray
) -> tuple[tuple[Instance, ...], np.ndarray]:
    """Instances as bright as the returns (n, 3) in their boxes, where these tell enough; spreads (i,) of these."""
    found, spread = [], np.full(len(instances), _UNSEEN)
    for row, instance in enumerate(instances):
        seen = Brightness.of(intensity[in_box(xyz, instance, 0.0)])
        told = seen.points >= _FEWEST
        found.append(replace(instance, paint=seen.mean) if told else instance)
        spread[row] = seen.spread if told else _UNSEEN
    return tuple(found), spread
