"""Likelihood of the measurements of each beam given a prediction.

A beam returns from the surface it hits with probability `seen`; its range error then follows a Student-t distribution
with 5 degrees of freedom, scaled to the stated standard deviation. Spurious returns have the density that scan effects
predict plus a small uniform density. Intensities are weighted by the probability that the return is from the surface,
and are censored at the sensor's limits (Tobit). Next to another material the intensity has a mixture distribution.
Beams near edges hit one of the sides, or none (`_mixed`); beams at the ends of maps may hit none (`MapEnds`).
The offset of a point perpendicular to its beam depends on the sensor, not on the surface. It is used for every return,
also for beams that cannot be compared with the twin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import special, stats

from cosim.discrepancy.inference.map_ends import MapEnds
from cosim.discrepancy.inference.mixture import mixture_weights
from cosim.discrepancy.sampling.sample import Prediction, Sample
from cosim.discrepancy.settings import LikelihoodConstants

NU = 5.0
SCALE = np.sqrt((NU - 2) / NU)
MEAN_INFORMATION = (NU + 1) / (NU + 3) * NU / (NU - 2)
SPREAD_INFORMATION = 2 * NU / (NU + 3)  # about log σ
_LOG_NORM = float(special.gammaln((NU + 1) / 2) - special.gammaln(NU / 2) - 0.5 * np.log(NU * np.pi))
_DARKEST = 1e-4  # intensity
_FAR = 8.0
_KNOTS = 1601


def student(z: np.ndarray) -> np.ndarray:
    """Log-density of a Student-t scaled to unit variance."""
    return _LOG_NORM - np.log(SCALE) - (NU + 1) / 2 * np.log1p(z**2 / (SCALE**2 * NU))


def student_score(z: np.ndarray) -> np.ndarray:
    """−d log f/dz of the unit-variance Student-t: bounded."""
    return (NU + 1) * z / (SCALE**2 * NU + z**2)


@dataclass(frozen=True, eq=False)
class Censored:
    """Censored likelihood of n values; arrays (n,).

    Attributes:
        loglik: log-density, or log-probability of values at a limit.
        score: derivative of `loglik` with respect to the mean, per standard deviation.
        information: expected square of the score; `MEAN_INFORMATION` far from the limits.
        spread_score: derivative of `loglik` with respect to the logarithm of the standard deviation.
    """

    loglik: np.ndarray
    score: np.ndarray
    information: np.ndarray
    spread_score: np.ndarray


def censored(value: np.ndarray, mean: np.ndarray, spread: np.ndarray, limits: tuple[float, float]) -> Censored:
    """Evaluate the censored likelihood of values (n,) with the given mean and σ before censoring."""
    low, high = ((limit - mean) / spread for limit in limits)
    z = (value - mean) / spread
    loglik, slope = student(z) - np.log(spread), student_score(z)
    spread_score = slope * z - 1
    for at, beyond, side in ((value <= limits[0], -low, -1.0), (value >= limits[1], high, 1.0)):
        room = beyond[at]
        outside = stats.t.sf(room / SCALE, NU)
        loglik[at] = np.log(outside)
        slope[at] = side * np.exp(student(room)) / outside
        spread_score[at] = slope[at] * side * room
    information = _information_below(high) + _information_below(-low) - MEAN_INFORMATION
    return Censored(loglik, slope, np.maximum(information, 0.0), spread_score)


def _information_below(room: np.ndarray) -> np.ndarray:
    """Information of values censored at `room` (n,) standard deviations above their mean."""
    return np.interp(room, *_table())


@cache
def _table() -> tuple[np.ndarray, np.ndarray]:
    room = np.linspace(-_FAR, _FAR, _KNOTS)
    square = student_score(room) ** 2 * np.exp(student(room))
    inside = np.append(0.0, np.cumsum((square[1:] + square[:-1]) / 2 * np.diff(room)))
    inside *= MEAN_INFORMATION / inside[-1]
    outside = np.exp(2 * student(room)) / stats.t.sf(room / SCALE, NU)
    return room, inside + outside


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of n beams; arrays (n,).

    Attributes:
        range_z, intensity_z, rise_z: residuals in standard deviations; 0 without a measurement.
        range_sigma_m, intensity_sigma: standard deviations that they are divided by.
        unshared_sigma_m: the part of `range_sigma_m` that neighbouring beams do not have in common.
        intensity_score, intensity_information: score and information of the intensity with respect to its mean, in
            standard deviations (see `Censored`). On a map that was made from the scans, the sensor's σ changes in
            proportion to the mean.
        either: probability before the measurement that the beam hits one of the sides of an edge; 1 away from edges.
        met: probability that the beam hit the surface of its row; 1 away from edges.
        matched: posterior probability that the return is from this surface.
        bright: posterior probability that the intensity is also from this surface; 0 if ambiguous.
        whole: bool, intensities that are practically never censored.
        seen: probability of a return from the surface, clipped away from 0 and 1.
        silent: probability that nothing is reported, clipped away from 0 and 1.
        expected_seen, expected_silent: both without clipping.
        not_missed: posterior probability that the beam neither misses the end of a map, see `MapEnds`, nor is stopped
            by what is not in the map.
        loglik: log-likelihood of each beam, in its first row.
        outcome: part of `loglik` from range and return only; 0 for beams that are not compared.
    """

    range_z: np.ndarray
    intensity_z: np.ndarray
    rise_z: np.ndarray
    range_sigma_m: np.ndarray
    unshared_sigma_m: np.ndarray
    intensity_sigma: np.ndarray
    intensity_score: np.ndarray
    intensity_information: np.ndarray
    either: np.ndarray
    met: np.ndarray
    matched: np.ndarray
    bright: np.ndarray
    whole: np.ndarray
    seen: np.ndarray
    silent: np.ndarray
    expected_seen: np.ndarray
    expected_silent: np.ndarray
    not_missed: np.ndarray
    loglik: np.ndarray
    outcome: np.ndarray


def residuals_of(sample: Sample, expected: Prediction, blur: float = 0.0) -> Residuals:
    """Compute the residuals and log-likelihood of a sample.

    Args:
        sample: sample of measured beams.
        expected: prediction for the same beams.
        blur: standard deviation [m] added to all ranges, so that fits with large residuals converge.
    """
    constants, mean, own = sample.settings.likelihood, expected.range_m, sample.own
    sigma = np.hypot(range_spread_m(expected, constants), blur)
    along_m, returned = sample.along_m[own], sample.returned[own]
    z = np.where(returned & np.isfinite(mean), (along_m - mean) / sigma, 0.0)
    z = np.nan_to_num(z)
    seen = np.where(np.isfinite(mean), np.clip(expected.seen, constants.lost_share, 1 - constants.lost_share), 0.0)
    kept = 1 - expected.spurious_share
    seen = np.where(sample.compared, seen, 0.0)
    expected_seen, expected_silent = (
        np.where(seen > 0, kept * chance, 0.0) for chance in (expected.seen, expected.silent)
    )
    # `seen` is not capped at 1 here: a beam with a return may be certain to have one.
    certain = np.where(sample.compared & np.isfinite(mean), np.maximum(expected.seen, constants.lost_share), 0.0)
    surface = certain * np.exp(student(z)) / sigma
    silent = np.maximum(expected.silent, constants.lost_share)
    density = surface + constants.least_spurious_share / constants.reach_m + expected.spurious_per_m
    outcome = kept * np.where(returned, density, silent) + np.where(returned, expected.spurious, 0.0)
    likelihood, either, met = _mixed(sample, outcome)
    loglik_of_outcome = np.where(sample.compared & sample.first, np.log(likelihood), 0.0)
    ends = MapEnds.of(sample, np.where(returned, np.maximum(certain, constants.lost_share), silent))
    if ends is not None:
        loglik_of_outcome += ends.loglik
    # Returns from what is not in a map are not compared; losses of as many beams are not either.
    compared_share = np.where(returned, 1.0, 1 - sample.unmapped)
    loglik_of_outcome *= compared_share
    loglik = loglik_of_outcome.copy()
    matched = np.where(returned, met * kept * surface / np.maximum(outcome, 1e-300), 0.0)

    rise = np.nan_to_num(sample.above_m - expected.rise_m)
    rise_z = np.where(sample.returned, rise / np.hypot(constants.rise_sigma_m, blur), 0.0)
    loglik += np.where(sample.returned, student(rise_z), 0.0)
    spread = intensity_spread(expected, constants)
    zeros = np.zeros(len(z))
    intensity = (
        _intensity_residuals(sample, expected, spread)
        if sample.has_intensity
        else (zeros, zeros, zeros, zeros, zeros > 0, zeros)
    )
    intensity_z, score, information, own_share, is_uncensored, loglik_of_intensity = intensity
    loglik += matched * loglik_of_intensity
    return Residuals(
        z,
        intensity_z,
        rise_z,
        sigma,
        np.hypot(unshared_spread_m(expected, constants), blur),
        spread,
        score,
        information,
        either,
        met,
        matched,
        matched * own_share,
        is_uncensored,
        seen,
        np.clip(silent, constants.lost_share, 1 - constants.lost_share),
        expected_seen,
        expected_silent,
        compared_share * (1.0 if ends is None else ends.met),
        loglik,
        loglik_of_outcome,
    )


def _mixed(sample: Sample, outcome: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Likelihoods (n,) of beams in their first rows, and probabilities (n,) of hitting either side and each surface.

    Beams near edges hit one of the sides, or an unknown surface: then they have a return near one of the sides, at a
    uniform range, or none. The shares of these are estimated by class, see `Sample.edge_class`. A beam that misses both
    sides goes on behind them: returns from before both, where nearby beams hit nothing, are not from surfaces of the
    scene. They take no part in the estimate, and are expected to be as rare as returns from far behind.

    Args:
        sample: sample of measured beams.
        outcome: (n,) likelihood of each beam's measurement if it hit the surface of this row.

    Returns:
        Likelihood; `Residuals.either` and `Residuals.met`.
    """
    either, met = np.ones(len(outcome)), np.ones(len(outcome))
    if not sample.edge.any():
        return outcome, either, met
    likelihood = np.bincount(sample.own, sample.chance * outcome, len(outcome))
    likelihood = np.where(sample.first, likelihood, 1.0)
    constants = sample.settings.likelihood
    outside_share = max(sample.share_behind_sides, constants.least_outside_share)
    for edge_class in range(int(sample.edge_class.max(initial=-1)) + 1):
        rows = np.flatnonzero(sample.edge_class == edge_class)
        near = rows[sample.first[rows]]
        if not len(near):
            continue
        neither = sample.unknown_surfaces[:, near]
        before = sample.is_before_sides[near]
        weight = np.where(before & ~before.all(), 0.0, sample.weight[near])
        share = mixture_weights(likelihood[near], neither, weight, constants)
        neither[-2] *= np.where(before, min(outside_share / share[-2], 1.0), 1.0)
        either[rows] = 1 - share.sum()
        likelihood[near] = either[near] * likelihood[near] + share @ neither
        met[rows] = (either * sample.chance * outcome)[rows] / likelihood[sample.own[rows]]
    return likelihood, either, met


def intensity_loglik(sample: Sample, expected: Prediction) -> np.ndarray:
    """Log-likelihood (n,) of the intensities if each return is from the traced surface."""
    return _intensity_residuals(sample, expected, intensity_spread(expected, sample.settings.likelihood))[-1]


def _intensity_residuals(sample: Sample, expected: Prediction, spread: np.ndarray) -> tuple[np.ndarray, ...]:
    """Intensity residuals if each return is from the traced surface; arrays (n,), see `Residuals`.

    Returns:
        z, score, information, probability that the intensity is from that surface, whether it is practically never
        censored, log-likelihood.
    """
    mean, limits, constants = expected.intensity, sample.intensity_limits, sample.settings.likelihood
    measured = np.where(sample.returned, sample.intensity, mean)
    likelihood = censored(measured, mean, spread, limits)
    # Residuals of values that noise moves across a limit are not normally distributed.
    is_uncensored = (
        np.minimum(mean - limits[0], limits[1] - mean) >= constants.clear_of_limits * expected.intensity_sigma
    )
    is_censored = (measured <= limits[0]) | (measured >= limits[1])
    other_likelihood = (1 - constants.own_at_seams) * np.where(is_censored, constants.cut_at_seams, 1.0)
    own_likelihood = constants.own_at_seams * np.exp(likelihood.loglik)
    own_share = np.where(sample.seam, own_likelihood / (own_likelihood + other_likelihood), 1.0) * ~sample.border
    loglik = np.where(sample.seam, np.log(own_likelihood + other_likelihood), likelihood.loglik) * ~sample.border
    score, information = likelihood.score, likelihood.information
    if sample.of_own_map:
        share = noise_slope(expected, constants) * spread
        score = score + likelihood.spread_score * share
        information = information + SPREAD_INFORMATION * np.where(is_censored, 0.0, share**2)
    return (measured - mean) / spread, score, information, own_share, is_uncensored, loglik


def noise_slope(expected: Prediction, constants: LikelihoodConstants) -> np.ndarray:
    """Derivative (n,) of the logarithm of the σ of intensities by the mean, with sensor noise in proportion to it."""
    sensor_share = (expected.intensity_sigma / intensity_spread(expected, constants)) ** 2
    return sensor_share / np.maximum(expected.intensity, _DARKEST)


def range_spread_m(expected: Prediction, constants: LikelihoodConstants) -> np.ndarray:
    """Standard deviation (n,) [m] of ranges: sensor noise and uncertainty of the twin."""
    return np.sqrt(expected.range_sigma_m**2 + expected.twin_sigma_m**2 + constants.range_floor_m**2)


def unshared_spread_m(expected: Prediction, constants: LikelihoodConstants) -> np.ndarray:
    """The part (n,) [m] of it that neighbouring beams do not have in common."""
    return np.sqrt(expected.range_sigma_m**2 + expected.twin_unshared_m**2 + constants.range_floor_m**2)


def intensity_spread(expected: Prediction, constants: LikelihoodConstants) -> np.ndarray:
    """Standard deviation (n,) of intensities: sensor noise and uncertainty of the twin, with its minimum."""
    return np.hypot(stated_intensity_spread(expected), constants.intensity_floor)


def stated_intensity_spread(expected: Prediction) -> np.ndarray:
    """Standard deviation (n,) of intensities without a minimum."""
    return np.hypot(expected.intensity_sigma, expected.twin_sigma_intensity)
