"""The beams of one revolution: as the sensor reports them, and as they are really emitted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sensors.rays import Rays


@dataclass(frozen=True, eq=False)
class Beams:
    """World pose of the emitting sensor: ego(t) · body · (LiDAR in ego) · mount, t = delay_s + firing_s.

    Attributes:
        rays: the n beams as the sensor reports them, LiDAR axes: optical centres and nominal directions.
        origin: (n, 3) float32 true optical centres in the sensor's own axes [m].
        direction: (n, 3) float32 true unit directions in the sensor's own axes.
        mount: (4, 4) float64 what the nominal pose of the LiDAR is multiplied by.
        body: (4, 4) float64 tilt of the vehicle's body in its own axes.
        delay_s: how much later than the pose time the world is seen [s].
        firing_s: (n,) float32 instant of each beam within the sweep [s]; None: all at once.
    """

    rays: Rays
    origin: np.ndarray
    direction: np.ndarray
    mount: np.ndarray
    body: np.ndarray
    delay_s: float = 0.0
    firing_s: np.ndarray | None = None

    @classmethod
    def nominal(cls, rays: Rays) -> Beams:
        """Beams that leave exactly as reported."""
        return cls(rays, rays.origin, rays.direction, np.eye(4), np.eye(4))

    def raised(self, angle_rad: np.ndarray | float) -> Beams:
        """Return the beams raised in their vertical planes by angles (n,), or one for all."""
        x, y, z = self.direction.astype(np.float64).T
        flat = np.hypot(x, y)
        cos, sin = np.cos(angle_rad), np.sin(angle_rad)
        shrink = np.divide(flat * cos - z * sin, flat, out=np.ones_like(flat), where=flat > 0)
        direction = np.stack([x * shrink, y * shrink, z * cos + flat * sin], 1)
        return replace(self, direction=direction.astype(np.float32))

    def turned(self, angle_rad: np.ndarray | float) -> Beams:
        """Return the beams turned counter-clockwise about the sensor's axis by angles (n,), or one for all."""
        x, y, z = self.direction.astype(np.float64).T
        cos, sin = np.cos(angle_rad), np.sin(angle_rad)
        direction = np.stack([x * cos - y * sin, x * sin + y * cos, z], 1)
        return replace(self, direction=direction.astype(np.float32))
