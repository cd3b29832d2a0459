"""How likely measurements are, beam by beam, under a prediction.

A beam returns from the surface it meets with probability `seen`; then its range scatters with heavy tails
(Student-t of 5 degrees of freedom scaled to the stated standard deviation). It may also return from elsewhere,
with a small uniform density on top of what scan effects say. Intensities count as far as the return is the surface's;
those at the limits of what the sensor tells say that they would have been there or beyond. Where another material
begins beside a beam, any brightness is as likely as its own.
Beams near edges meet either side, or neither (`_mixed`).
Where a return stands above its beam tells of the sensor whatever surface it was, so it counts for every return, and is
all that counts of beams that cannot be compared with the twin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import special, stats

from cosim.discrepancy.sampling.sample import Prediction, Sample
from cosim.discrepancy.settings import Law

NU = 5.0
SCALE = np.sqrt((NU - 2) / NU)
MEAN_INFORMATION = (NU + 1) / (NU + 3) * NU / (NU - 2)
_LOG_NORM = float(special.gammaln((NU + 1) / 2) - special.gammaln(NU / 2) - 0.5 * np.log(NU * np.pi))
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
    """Of n values.

    Attributes:
        loglik: log-density, or log-probability of those at a limit.
        score: its slope against the expected value, in standard deviations.
        information: expected square of the slope; `MEAN_INFORMATION` far from limits.
    """

    loglik: np.ndarray
    score: np.ndarray
    information: np.ndarray


def censored(value: np.ndarray, mean: np.ndarray, spread: np.ndarray, limits: tuple[float, float]) -> Censored:
    """Hold values (n,) against what is expected of them before they are cut off at the limits."""
    low, high = ((limit - mean) / spread for limit in limits)
    z = (value - mean) / spread
    loglik, slope = student(z) - np.log(spread), student_score(z)
    for at, beyond, side in ((value <= limits[0], -low, -1.0), (value >= limits[1], high, 1.0)):
        room = beyond[at]
        outside = stats.t.sf(room / SCALE, NU)
        loglik[at] = np.log(outside)
        slope[at] = side * np.exp(student(room)) / outside
    information = _known_below(high) + _known_below(-low) - MEAN_INFORMATION
    return Censored(loglik, slope, np.maximum(information, 0.0))


def _known_below(room: np.ndarray) -> np.ndarray:
    """Information of values cut off at `room` (n,) standard deviations above their mean."""
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
    """Of n beams.

    Attributes:
        range_z, intensity_z, rise_z: residuals in standard deviations; 0 where there are none.
        intensity_score, intensity_known: what intensities say of their mean, and how much they would on average, in
            standard deviations.
        met: probability that the beam met its row's surface; 1 away from edges.
        matched: probability that the return is the surface's.
        bright: probability that its brightness is, too; 0 where that is not to be told.
        whole: (n,) bool: intensities that the limits hardly ever cut off.
        seen: probability of a return of the surface, away from 0 and 1.
        expected_seen: the same as it is expected: of a beam that is certain to return no return tells anything.
        loglik: (n,) log-likelihood, of each beam in its first row.
        outcome: (n,) log-likelihood of range and return alone; 0 where a beam is not compared.
    """

    range_z: np.ndarray
    intensity_z: np.ndarray
    rise_z: np.ndarray
    range_sigma_m: np.ndarray
    intensity_sigma: np.ndarray
    intensity_score: np.ndarray
    intensity_known: np.ndarray
    met: np.ndarray
    matched: np.ndarray
    bright: np.ndarray
    whole: np.ndarray
    seen: np.ndarray
    expected_seen: np.ndarray
    loglik: np.ndarray
    outcome: np.ndarray


def residuals_of(sample: Sample, expected: Prediction, blur: float = 0.0) -> Residuals:
    """Hold measurements against a prediction.

    Args:
        sample: the measurements.
        expected: of the same beams.
        blur: a standard deviation [m] added to every range: fits that are far off find their way with it.
    """
    law, mean, own = sample.settings.law, expected.range_m, sample.own
    sigma = np.hypot(range_spread_m(expected, law), blur)
    along_m, returned = sample.along_m[own], sample.returned[own]
    z = np.where(returned & np.isfinite(mean), (along_m - mean) / sigma, 0.0)
    z = np.nan_to_num(z)
    seen = np.where(np.isfinite(mean), np.clip(expected.seen, law.lost_share, 1 - law.lost_share), 0.0)
    kept = 1 - expected.spurious_share
    seen = np.where(sample.compared, seen, 0.0)
    whole = np.where(seen > 0, kept * expected.seen, 0.0)
    # That a beam returned shows a loss however rare; of beams that did not, none is certain to.
    certain = np.where(sample.compared & np.isfinite(mean), np.maximum(expected.seen, law.lost_share), 0.0)
    surface = certain * np.exp(student(z)) / sigma
    # What fog and its like add near edges cannot be told from what else stands there: these tell the rest, given that.
    untouched = np.where(sample.edge, np.maximum(expected.seen + expected.silent, law.lost_share), 1.0)
    elsewhere = law.stray_share / law.reach_m + np.where(sample.edge, expected.split, expected.stray)
    density = surface + elsewhere
    outcome = kept * np.where(returned, density, np.maximum(expected.silent, law.lost_share)) / untouched
    outcome = outcome + np.where(returned, expected.spurious, 0.0)
    likelihood, met = _mixed(sample, outcome)
    of_outcome = np.where(sample.compared & sample.first, np.log(likelihood), 0.0)
    loglik = of_outcome.copy()
    matched = np.where(returned, met * kept * surface / untouched / np.maximum(outcome, 1e-300), 0.0)

    rise = np.nan_to_num(sample.above_m - expected.rise_m)
    rise_z = np.where(sample.returned, rise / np.hypot(law.rise_sigma_m, blur), 0.0)
    loglik += np.where(sample.returned, student(rise_z), 0.0)
    spread = intensity_spread(expected, law)
    none = np.zeros(len(z))
    light = _light(sample, expected, spread) if sample.has_intensity else (none, none, none, none, none > 0, none)
    light_z, score, known, whose, uncut, of_light = light
    loglik += matched * of_light
    return Residuals(
        z,
        light_z,
        rise_z,
        sigma,
        spread,
        score,
        known,
        met,
        matched,
        matched * whose,
        uncut,
        seen,
        whole,
        loglik,
        of_outcome,
    )


def _mixed(sample: Sample, outcome: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Likelihoods (n,) of beams in their first rows, and the probability (n,) that they met the surface of each row.

    Beams near edges met one of the sides, or neither: these return from anywhere, or not at all.

    Args:
        sample: the measurements.
        outcome: (n,) likelihood of what each beam did, if it met the surface of that row.
    """
    near, rows = np.flatnonzero(sample.edge & sample.first), np.flatnonzero(sample.edge)
    if not len(near):
        return outcome, np.ones(len(outcome))
    likelihood = np.where(sample.first, np.bincount(sample.own, sample.chance * outcome, len(outcome)), 1.0)
    law, returned = sample.settings.law, sample.returned[near]
    neither = np.stack([returned / law.reach_m, ~returned])
    share = shares_of_neither(likelihood[near], neither, sample.weight[near], law)
    either, met = 1 - share.sum(), np.ones(len(outcome))
    likelihood[near] = either * likelihood[near] + share @ neither
    met[rows] = either * (sample.chance * outcome)[rows] / likelihood[sample.own[rows]]
    return likelihood, met


def shares_of_neither(sides: np.ndarray, neither: np.ndarray, weight: np.ndarray, law: Law) -> np.ndarray:
    """The likeliest shares (c,) of components of a mixture (Dempster, Laird and Rubin, J. R. Stat. Soc. B 1977).

    Being the likeliest, they leave slopes of the likelihood as if they were known.

    Args:
        sides: (k,) likelihoods of the component that has what the others leave.
        neither: (c, k) likelihoods of these.
        weight: (k,) how much each counts.
        law: settings.
    """
    share, before = np.full(len(neither), law.neither_share), np.zeros(len(neither))
    while np.abs(share - before).max() > law.neither_known:
        before, parts = share, share[:, None] * neither
        share = parts / ((1 - share.sum()) * sides + parts.sum(0)) @ weight / weight.sum()
    return share


def _light(sample: Sample, expected: Prediction, spread: np.ndarray) -> tuple[np.ndarray, ...]:
    """What intensities say if returns are the surfaces' they were traced to, as in `Residuals`.

    Their z, score, known, own and whole; own is the probability that the brightness is that surface's; at the end
    (n,) log-likelihoods.
    """
    mean, limits, law = expected.intensity, sample.intensity_limits, sample.settings.law
    measured = np.where(sample.returned, sample.intensity, mean)
    told = censored(measured, mean, spread, limits)
    # Where noise would be cut off at a limit a residual is no normal deviate.
    whole = np.minimum(mean - limits[0], limits[1] - mean) >= law.clear_of_limits * expected.intensity_sigma
    cut = (measured <= limits[0]) | (measured >= limits[1])
    other = (1 - law.own_at_seams) * np.where(cut, law.cut_at_seams, 1.0)
    mine = law.own_at_seams * np.exp(told.loglik)
    own = np.where(sample.seam, mine / (mine + other), 1.0) * ~sample.border
    loglik = np.where(sample.seam, np.log(mine + other), told.loglik) * ~sample.border
    return (measured - mean) / spread, told.score, told.information, own, whole, loglik


def range_spread_m(expected: Prediction, law: Law) -> np.ndarray:
    """Standard deviation (n,) [m] of ranges: by the sensor's noise and by how far the twin may be off."""
    return np.sqrt(expected.range_sigma_m**2 + expected.unsure_m**2 + law.range_floor_m**2)


def intensity_spread(expected: Prediction, law: Law) -> np.ndarray:
    """The same of intensities."""
    return np.sqrt(expected.intensity_sigma**2 + expected.unsure_intensity**2 + law.intensity_floor**2)
