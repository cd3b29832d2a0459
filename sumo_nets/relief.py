"""The ground of a town: a smooth height above sea level for every point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sumo_nets.recipe import Relief


@dataclass(frozen=True)
class TerrainHeights:
    """A sum of sinusoids, z = Σ aᵢ sin(kᵢ·p + φᵢ) − offset.

    Attributes:
        amplitude_m: (n,) heights.
        wave_per_m: (n, 2) wave vectors, radians a metre east and north.
        phase_rad: (n,) phases.
        offset_m: subtracted, so that the town's mean height is zero.
    """

    amplitude_m: np.ndarray
    wave_per_m: np.ndarray
    phase_rad: np.ndarray
    offset_m: float

    def height(self, xy: np.ndarray) -> np.ndarray:
        """Return the height in metres at (…, 2) points, world metres."""
        angle = np.asarray(xy, dtype=np.float64) @ self.wave_per_m.T + self.phase_rad
        return np.sin(angle) @ self.amplitude_m - self.offset_m

    def grade(self, xy: np.ndarray) -> np.ndarray:
        """Return the steepest grade, rise over run, at (…, 2) points."""
        angle = np.asarray(xy, dtype=np.float64) @ self.wave_per_m.T + self.phase_rad
        gradient = (np.cos(angle) * self.amplitude_m) @ self.wave_per_m
        return np.linalg.norm(gradient, axis=-1)


def make_ground(relief: Relief, half_size_m: float, rng: np.random.Generator) -> TerrainHeights:
    """Draw a ground that spans the relief's range, flattened where it would be steeper than allowed.

    Args:
        relief: range, wavelengths and steepest grade.
        half_size_m: the town lies within ± this distance of the origin.
        rng: source of directions and phases.
    """
    heading = rng.uniform(0, 2 * np.pi, relief.waves)
    wavelength = rng.uniform(*relief.wavelength_m, relief.waves)
    wave = (2 * np.pi / wavelength)[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    raw = TerrainHeights(wavelength / wavelength.mean(), wave, rng.uniform(0, 2 * np.pi, relief.waves), 0.0)
    axis = np.linspace(-half_size_m, half_size_m, 101)
    samples = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    height = raw.height(samples)
    scale = min(relief.range_m / np.ptp(height), relief.max_grade / raw.grade(samples).max())
    return TerrainHeights(raw.amplitude_m * scale, wave, raw.phase_rad, float(height.mean() * scale))
