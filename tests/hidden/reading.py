"""Hidden physics of measured ranges and intensities; noise of several distributions."""

from __future__ import annotations

import numpy as np

from tests.hidden.scan import Scan


def range_bias(scan: Scan, rng, offset_m: float) -> None:
    scan.range_m += offset_m


def range_scale(scan: Scan, rng, scale_ppm: float) -> None:
    scan.range_m *= 1 + scale_ppm * 1e-6


def ring_range_offset(scan: Scan, rng, offsets_m: list[float]) -> None:
    scan.range_m += np.asarray(offsets_m)[scan.beams.ring]


def range_walk(scan: Scan, rng, amplitude_m: float, decay: float) -> None:
    scan.range_m += amplitude_m * np.exp(-decay * scan.intensity)


def incidence_bias(scan: Scan, rng, gain_m: float) -> None:
    cos = np.clip(scan.cos, 1e-6, 1)
    scan.range_m += gain_m * np.minimum(np.sqrt(1 - cos**2) / cos, 10)


def intensity_noise(scan: Scan, draw, sigma_rel: float) -> None:
    scan.intensity *= 1 + sigma_rel * draw(len(scan.intensity))


def range_noise(scan: Scan, draw, sigma_m: float, sigma_per_m: float = 0.0) -> None:
    scan.range_m += np.hypot(sigma_m, sigma_per_m * scan.range_m) * draw(len(scan.range_m))


def intensity_quantization(scan: Scan, rng, step: float) -> None:
    scan.intensity = np.round(np.clip(scan.intensity, 0, 1) / step) * step


def range_quantization(scan: Scan, rng, step_m: float) -> None:
    scan.range_m = np.round(scan.range_m / step_m) * step_m


def gaussian(rng: np.random.Generator, n: int) -> np.ndarray:
    """Normal distribution of standard deviation 1, as assumed by sensor models."""
    return rng.normal(size=n)


def laplace(rng: np.random.Generator, n: int) -> np.ndarray:
    """Standard deviation 1."""
    return rng.laplace(scale=2**-0.5, size=n)


def logistic(rng: np.random.Generator, n: int) -> np.ndarray:
    """Standard deviation 1."""
    return rng.logistic(scale=3**0.5 / np.pi, size=n)


def student5(rng: np.random.Generator, n: int) -> np.ndarray:
    """Five degrees of freedom, standard deviation 1."""
    return rng.standard_t(5, n) * (3 / 5) ** 0.5


def student3(rng: np.random.Generator, n: int) -> np.ndarray:
    """Three degrees of freedom, standard deviation 1: heavy tails."""
    return rng.standard_t(3, n) * (1 / 3) ** 0.5


LAWS = {"gaussian": gaussian, "laplace": laplace, "logistic": logistic, "student5": student5, "student3": student3}
