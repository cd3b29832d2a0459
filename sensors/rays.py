"""Beams as a sensor fires them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True, eq=False)
class Rays:
    """The beams of one revolution, ring-major, in LiDAR axes (x forward, y left, z up).

    Attributes:
        origin: (n, 3) float32 optical centres [m].
        direction: (n, 3) float32 unit vectors.
        ring: (n,) uint8, 0 on top.
        azimuth: (n,) float32 nominal beam azimuth [rad], counter-clockwise from +x, in (−π, π].
        time_s: (n,) float32 firing time from the pose time [s].
    """

    origin: np.ndarray
    direction: np.ndarray
    ring: np.ndarray
    azimuth: np.ndarray
    time_s: np.ndarray

    def __len__(self) -> int:
        return len(self.ring)

    @cached_property
    def one_centre(self) -> bool:
        """Whether all beams leave from the sensor's origin."""
        return not self.origin.any()
