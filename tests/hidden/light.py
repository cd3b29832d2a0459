"""Hidden physics of signal and detection."""

from __future__ import annotations

import numpy as np

from tests.hidden.scan import Scan


def incidence_falloff(scan: Scan, rng, exponent: float) -> None:
    scan.intensity *= scan.cos**exponent


def range_falloff(scan: Scan, rng, reference_m: float, exponent: float) -> None:
    scan.intensity *= (1 + scan.range_m / reference_m) ** -exponent


def atmospheric_extinction(scan: Scan, rng, alpha_per_m: float) -> None:
    scan.intensity *= np.exp(-2 * alpha_per_m * scan.range_m)
    scan.found &= scan.intensity >= 0.005


def focal_response(scan: Scan, rng, focal_distance_m: float, slope: float) -> None:
    focus = 256 * (1 - focal_distance_m * 100 / 13100) ** 2
    here = 256 * (1 - scan.range_m / 0.002 / 65535) ** 2
    scan.intensity += slope / 255 * np.abs(focus - here)


def ring_gain(scan: Scan, rng, gains: list[float]) -> None:
    scan.intensity *= np.asarray(gains)[scan.beams.ring]


def retroreflection(scan: Scan, rng, gain: float) -> None:
    retro = scan.found & scan.table.retro[scan.material]
    scan.intensity[retro] *= gain


def detection_threshold(scan: Scan, rng, threshold: float, softness: float) -> None:
    chance = 1 / (1 + np.exp(np.clip((threshold - scan.intensity) / softness, -60, 60)))
    scan.found &= rng.random(len(chance)) < chance


def random_dropout(scan: Scan, rng, probability: float) -> None:
    scan.found &= rng.random(len(scan.found)) >= probability


def max_range(scan: Scan, rng, range_m: float) -> None:
    scan.found &= scan.range_m <= range_m * np.sqrt(scan.rho / 0.1)
