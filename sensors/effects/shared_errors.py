"""Errors that all beams of a unit share: a firing, a packet, a sector, a scan, a block or a ring in a scan.

Each unit of each scan draws one standard normal number z from the effect's own random stream.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar

import numpy as np
from scipy.special import ndtr

from sensors.effects.base import DetectionEffect, Effect, NoiseEffect, number
from sensors.effects.phases import Channel, Phase
from sensors.normals import decode_normals
from sensors.returns import Returns
from sensors.shot import Shot

PACKET_FIRINGS = 6  # HDL-64E and HDL-64E S2; 12 of an HDL-32E, 24 of a VLP-16
SECTORS = 36
STEEPEST_M_PER_RAD = 300.0
UNITS = ("firing", "packet", "sector", "scan", "block", "ring")


class SharedEffect(Effect):
    """An error that the beams of a unit have in common.

    Class attributes:
        shared_by: the unit, one of `UNITS`.
        unit_size: firings of a packet, or sectors of a turn.
    """

    shared_by: ClassVar[str] = "firing"
    unit_size: ClassVar[int] = 1

    def group(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the number (m,) of each return's unit within the scan."""
        return self._unit(returns, shot)[0]

    def draw(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> np.ndarray:
        """Return a standard normal number (m,) for each return, one per unit."""
        unit, count = self._unit(returns, shot)
        return rng.standard_normal(count)[unit]

    def _unit(self, returns: Returns, shot: Shot) -> tuple[np.ndarray, int]:
        """Unit (m,) of each return, and their number."""
        firings = shot.pattern.firings

        def of(returns: Returns) -> np.ndarray:
            is_whole = len(shot.rays) == firings * shot.pattern.rings
            return returns.beam % firings if is_whole else shot.firing(returns)

        units: dict[str, Callable[[], tuple[np.ndarray, int]]] = {
            "firing": lambda: (of(returns), firings),
            "packet": lambda: (of(returns) // self.unit_size, -(-firings // self.unit_size)),
            "sector": lambda: (of(returns) * self.unit_size // firings, self.unit_size),
            "scan": lambda: (np.zeros(len(returns), int), 1),
            "block": lambda: (shot.block[returns.beam].astype(int), 2),
            "ring": lambda: (shot.rays.ring[returns.beam].astype(int), shot.pattern.rings),
        }
        if self.shared_by not in units:
            raise ValueError(f"shared_by is {self.shared_by!r}; choose one of {', '.join(UNITS)}")
        return units[self.shared_by]()


class SharedRange(SharedEffect, NoiseEffect):
    """R + σ·z."""

    phase: ClassVar[Phase] = Phase.SHARED_NOISE
    channel: ClassVar[Channel] = "shared_range"
    also: ClassVar[tuple[Channel, ...]] = ("range_variance",)

    sigma: float = number("standard deviation of the shared error", unit="m", ge=0)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns with other ranges."""
        error_m = self.sigma * self.draw(returns, shot, rng)
        return replace(returns, range_m=returns.range_m + error_m.astype(np.float32))

    def spread(self, returns: Returns, shot: Shot) -> tuple[float, float]:
        """Return σ of range."""
        return self.sigma, 0.0


class SharedIntensity(SharedEffect, NoiseEffect):
    """I·(1 + σ·z)."""

    phase: ClassVar[Phase] = Phase.SHARED_NOISE
    channel: ClassVar[Channel] = "shared_intensity"
    also: ClassVar[tuple[Channel, ...]] = ("intensity_variance",)

    sigma: float = number("standard deviation of the shared error, relative to the intensity", ge=0)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns with intensities multiplied."""
        factor = 1 + self.sigma * self.draw(returns, shot, rng)
        return replace(returns, intensity=returns.intensity * factor.astype(np.float32))

    def spread(self, returns: Returns, shot: Shot) -> tuple[float, np.ndarray]:
        """Return σ of intensity, in proportion to it."""
        return 0.0, np.float32(self.sigma) * np.abs(returns.intensity)


class SharedDrop(SharedEffect, DetectionEffect):
    """P(return)·(1 + σ·z), within 0–1: what is lost before stays lost, so that only z < 0 changes anything."""

    channel: ClassVar[Channel] = "shared_drop"
    also: ClassVar[tuple[Channel, ...]] = ("drop",)

    sigma: float = number("standard deviation of the relative change of the probability", ge=0)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns that are noticed."""
        chance = 1 + self.sigma * self.draw(returns, shot, rng)
        return returns.take(shot.per_return(returns, rng.random((2, len(shot.rays)))) < chance)

    def kept(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the mean (m,) over z of the probability of a return: E min(1, max(0, 1 + σ·z))."""
        if self.sigma == 0:
            return np.ones(len(returns))
        end = 1 / self.sigma
        lost = self.sigma * (1 - np.exp(-(end**2) / 2)) / np.sqrt(2 * np.pi) + ndtr(-end)
        return np.full(len(returns), 1 - lost)


class _SharedAngle(SharedEffect, NoiseEffect):
    """An error δ = σ·z of the beams' direction, as it changes ranges: R + d·δ/(1 − d·δ/R), d = ∂R/∂angle.

    The surface is continued as a plane; beams at so flat an angle that |d| > 300 m/rad keep their ranges.
    """

    phase: ClassVar[Phase] = Phase.SHARED_NOISE
    also: ClassVar[tuple[Channel, ...]] = ("range_variance",)

    sigma: float = number("standard deviation of the shared error", unit="rad", ge=0)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns with other ranges."""
        shift_m = self._derivative(returns, shot) * self.sigma * self.draw(returns, shot, rng)
        ratio = np.clip(shift_m / np.maximum(returns.range_m, 0.5), -1.0, 0.5)
        return replace(returns, range_m=returns.range_m + (shift_m / (1 - ratio)).astype(np.float32))

    def spread(self, returns: Returns, shot: Shot) -> tuple[np.ndarray, float]:
        """Return the standard deviation (m,) of range."""
        return np.abs(self._derivative(returns, shot)) * self.sigma, 0.0

    def _derivative(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Change (m,) of the range per angle [m/rad]."""
        direction = shot.direction_in_world(returns).astype(float)
        normal = decode_normals(returns.normal_code).astype(float)
        change = np.einsum("ij,ij->i", normal, self._turned(direction, shot.lidar_pose[:3, 2]))
        slope = np.einsum("ij,ij->i", normal, direction)
        with np.errstate(divide="ignore", invalid="ignore"):
            derivative = -returns.range_m * change / slope
        return np.where(np.abs(derivative) < STEEPEST_M_PER_RAD, derivative, 0.0)

    def _turned(self, direction: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Derivative (m, 3) of unit directions (m, 3) with respect to the angle, `up` (3,) the sensor's axis."""
        raise NotImplementedError


class SharedAzimuthError(_SharedAngle):
    """True azimuth = reported + σ·z."""

    channel: ClassVar[Channel] = "shared_azimuth_error"

    def _turned(self, direction: np.ndarray, up: np.ndarray) -> np.ndarray:
        return np.cross(up, direction)


class SharedElevationError(_SharedAngle):
    """True elevation = reported + σ·z."""

    channel: ClassVar[Channel] = "shared_elevation_error"

    def _turned(self, direction: np.ndarray, up: np.ndarray) -> np.ndarray:
        rise = direction @ up
        return (up - rise[:, None] * direction) / np.sqrt(np.maximum(1 - rise**2, 1e-12))[:, None]
