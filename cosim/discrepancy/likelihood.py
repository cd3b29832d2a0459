"""How likely measurements are, beam by beam, under a prediction.

A beam returns from the surface it meets with probability `seen`; then its range scatters with heavy tails
(Student-t of 5 degrees of freedom scaled to the stated standard deviation). It may also return from elsewhere,
with a small uniform density on top of what scan effects say. Intensities count as far as the return is the surface's.
Where a return stands above its beam tells of the sensor whatever surface it was, so it counts for every return, and is
all that counts of beams that cannot be compared with the twin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from cosim.discrepancy.sample import Prediction, Sample

NU = 5.0
RANGE_FLOOR_M = 5e-4
INTENSITY_FLOOR = 0.002
RISE_SIGMA_M = 0.003
_STRAY_SHARE = 1e-4
_REACH_M = 120.0
_CLEAR_OF_LIMITS = 2.5
_LOST_SHARE = 1e-3
_SCALE = np.sqrt((NU - 2) / NU)
_LOG_NORM = float(gammaln((NU + 1) / 2) - gammaln(NU / 2) - 0.5 * np.log(NU * np.pi))


@dataclass(frozen=True, eq=False)
class Fit:
    """Of n beams.

    Attributes:
        range_z, intensity_z, rise_z: residuals in standard deviations; 0 where there are none.
        matched: probability that the return is the surface's.
        bright: the same where the intensity tells something, else 0.
        seen: probability of a return of the surface, away from 0 and 1.
        loglik: (n,) log-likelihood.
    """

    range_z: np.ndarray
    intensity_z: np.ndarray
    rise_z: np.ndarray
    range_sigma_m: np.ndarray
    intensity_sigma: np.ndarray
    matched: np.ndarray
    bright: np.ndarray
    seen: np.ndarray
    loglik: np.ndarray


def judge(sample: Sample, expected: Prediction, blur: float = 0.0, shift: np.ndarray | None = None) -> Fit:
    """Hold measurements against a prediction.

    Args:
        sample: the measurements.
        expected: of the same beams.
        blur: a standard deviation [m] added to every range: fits that are far off find their way with it.
        shift: (n,) what is added to expected ranges [m], as pose errors do.
    """
    sigma = np.hypot(range_spread_m(expected), blur)
    mean = expected.range_m if shift is None else expected.range_m + shift
    returned = sample.returned
    z = np.where(returned & np.isfinite(mean), (sample.along_m - mean) / sigma, 0.0)
    z = np.nan_to_num(z)
    seen = np.where(np.isfinite(mean), _LOST_SHARE + (1 - 2 * _LOST_SHARE) * expected.seen, 0.0)
    seen = np.where(sample.compared, seen, 0.0)
    surface = seen * np.exp(student(z)) / sigma
    elsewhere = _STRAY_SHARE / _REACH_M + expected.stray
    density = surface + elsewhere
    loglik = np.where(returned, np.log(density), np.log(np.maximum(expected.silent, _LOST_SHARE)))
    loglik = np.where(sample.compared, loglik, 0.0)
    matched = np.where(returned, surface / density, 0.0)

    rise = np.nan_to_num(sample.above_m - expected.rise_m)
    rise_z = np.where(returned, rise / np.hypot(RISE_SIGMA_M, blur), 0.0)
    loglik += np.where(returned, student(rise_z), 0.0)
    spread = intensity_spread(expected)
    intensity_z, bright = np.zeros(len(z)), np.zeros(len(z))
    if sample.has_intensity:
        # Where noise would be cut off at 0 or 1 a residual is no normal deviate.
        room = np.minimum(expected.intensity, 1 - expected.intensity) >= _CLEAR_OF_LIMITS * expected.intensity_sigma
        intensity_z = np.where(room, np.nan_to_num((sample.intensity - expected.intensity) / spread), 0.0)
        bright = matched * (room & ~sample.border)
        loglik += bright * (student(intensity_z) - np.log(spread))
    return Fit(z, intensity_z, rise_z, sigma, spread, matched, bright, seen, loglik)


def range_spread_m(expected: Prediction) -> np.ndarray:
    """Standard deviation (n,) [m] of ranges: by the sensor's noise and by how far the twin may be off."""
    return np.sqrt(expected.range_sigma_m**2 + expected.unsure_m**2 + RANGE_FLOOR_M**2)


def intensity_spread(expected: Prediction) -> np.ndarray:
    """The same of intensities."""
    return np.sqrt(expected.intensity_sigma**2 + expected.unsure_intensity**2 + INTENSITY_FLOOR**2)


def student(z: np.ndarray) -> np.ndarray:
    """Log-density of a Student-t scaled to unit variance."""
    return _LOG_NORM - np.log(_SCALE) - (NU + 1) / 2 * np.log1p(z**2 / (_SCALE**2 * NU))


def pull(z: np.ndarray) -> np.ndarray:
    """−d log f/dz of the unit-variance Student-t: bounded."""
    return (NU + 1) * z / (_SCALE**2 * NU + z**2)
