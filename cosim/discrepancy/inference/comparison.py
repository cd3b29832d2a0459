"""How much better one model is than another on the same beams: one comparison for everything that may be added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import stats

from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.likelihood import Residuals, student
from cosim.discrepancy.sampling.sample import Sample

ToldBy = Literal["beams", "noise", "poses"]  # what tells of a change: see `gain`


@dataclass(frozen=True, eq=False)
class Gain:
    """A difference of log-likelihoods by cluster.

    Attributes:
        value: of the whole sample, whose beams weigh one on average.
        error: its standard error, from cluster to cluster.
        freedom: degrees of freedom of that error.
        sums: of each clustering (clusters,) what each cluster adds; the same clusters of all models of one sample.
        of_shape: what of the likelihood's gain was left out, as the noise's shape alone would make it.
    """

    value: float
    error: float
    freedom: float
    sums: tuple[np.ndarray, ...]
    of_shape: float = 0.0

    @property
    def p_value(self) -> float:
        """One-sided, of a t-test that there is none."""
        if self.error <= 0 or self.freedom < 1:
            return 1.0
        return float(stats.t.sf(self.value / self.error, self.freedom))

    @classmethod
    def of(cls, strata: Sequence[np.ndarray]) -> Gain:
        """From differences by cluster, in strata whose clusters are alike (Welch–Satterthwaite)."""
        used = [one[one != 0] for one in strata]
        used = [one for one in used if len(one) > 1]
        sums = (np.concatenate(strata),)
        value = float(sums[0].sum())
        squares = np.array([len(one) * float(np.var(one, ddof=1)) for one in used])
        total = float(squares.sum())
        if total <= 0:
            return cls(value, 0.0, 0.0, sums)
        degrees = np.array([len(one) - 1 for one in used])
        return cls(value, float(np.sqrt(total)), total**2 / float((squares**2 / degrees).sum()), sums)

    def without_outlier(self) -> Gain:
        """A lower bound that is surer where one cluster gains more than all others that gain together; else the same.

        Its gain is cut off at the size of the next largest difference (Winsor; Dixon, Ann. Math. Stat. 1960).
        """
        if all(2 * one.max() <= one.clip(0).sum() for one in self.sums) or min(map(len, self.sums)) < 2:
            return self
        cut = [np.minimum(one, np.sort(np.abs(one))[-2]) for one in self.sums]
        return max((Gain.of([one]) for one in cut), key=lambda one: one.p_value)


def gain(fitter: Fitter, before: Fitted, after: Fitted, by: ToldBy = "beams") -> Gain:
    """Gain of one fit over another, random effects with their laws.

    The gain per beam does not depend on how many beams were drawn; its error is of clusters: objects, cells of the
    map, and scans, whatever their number of beams.

    Args:
        fitter: of the sample that both are of.
        before, after: fits, or models as they are with random effects fitted.
        by: beams and random effects; or how neighbours differ, which no misfit of the mean enters; or pose errors
            alone: beams are as likely where an effect moves them as where these do, but for what planes do not tell.
    """
    clusters, sample, of_shape = fitter.random.clusters, fitter.sample, 0.0
    if by == "noise":
        beams = _quasi_likelihood(sample, after.residuals) - _quasi_likelihood(sample, before.residuals)
        law = np.zeros(fitter.random.size)
    else:
        beams = sample.share * (after.residuals.loglik - before.residuals.loglik)
        shape = _of_shape(sample, after.residuals) - _of_shape(sample, before.residuals)
        if shape.sum() > 0:
            beams, of_shape = beams - shape, float(shape.sum())
        known = fitter.random.informed(before.prediction, before.evidence)
        law = _of_law(fitter, after, known) - _of_law(fitter, before, known)
    if by == "poses":
        beams, law = np.zeros(len(beams)), np.where(clusters.unit_scan >= 0, law, 0.0)
    scans = np.bincount(clusters.unit_scan[clusters.unit_scan >= 0], law[clusters.unit_scan >= 0])
    things = np.where(clusters.unit_track >= 0, law, 0.0)
    by_track = np.bincount(clusters.track, beams)
    by_track = by_track + np.bincount(np.maximum(clusters.unit_track, 0), things, len(by_track))[: len(by_track)]
    by_part = np.bincount(clusters.part, beams)
    by_thing = np.bincount(np.maximum(clusters.unit_track, 0), things)
    found = [Gain.of([by_track, scans]), Gain.of([by_part, scans, by_thing])]
    unsure = max(found, key=lambda one: one.error)
    return replace(unsure, sums=tuple(one.sums[0] for one in found), of_shape=of_shape)


def stability(gains: Sequence[Gain], prices: Sequence[float], halves: int, rng: np.random.Generator) -> np.ndarray:
    """Share (k,) of random halves of the clusters in which each of k models is the best.

    A half in which none gains more than its price is won by none. The clustering that is less sure of a winner counts
    (stability selection: Meinshausen and Bühlmann, J. R. Stat. Soc. B 2010; Shah and Samworth, same journal, 2013).

    Args:
        gains: of the models over the same other one, on the same sample.
        prices: gain that each must bring on half a sample.
        halves: how many are drawn.
        rng: for the draws.
    """
    found = []
    for clustering in zip(*(one.sums for one in gains), strict=True):
        count = len(clustering[0])
        drawn = rng.permuted(np.tile(np.arange(count) < (count + 1) // 2, (halves, 1)), axis=1)
        worth = drawn @ np.stack(clustering, 1) - np.asarray(prices)
        won = np.bincount(np.where(worth.max(1) > 0, worth.argmax(1), len(gains)), minlength=len(gains) + 1)
        found.append(won[:-1] / halves)
    return min(found, key=lambda share: float(share.max()))


def _of_law(fitter: Fitter, fitted: Fitted, known: np.ndarray) -> np.ndarray:
    """(m,) what each random effect adds to the marginal log-likelihood beside that of beams (Laplace).

    Its log-density where it is, and half the log of how much narrower beams make it; `known` (m,) is what they tell.
    """
    active = fitter.random.active(fitted.estimate)
    precision = np.where(active, fitter.random.precision(fitted.estimate), 1.0)
    return np.where(
        active, -0.5 * fitted.estimate.u**2 * precision + 0.5 * np.log(precision / (precision + known)), 0.0
    )


def _of_shape(sample: Sample, residuals: Residuals) -> np.ndarray:
    """(n,) what the law of ranges adds to their quasi-likelihood −½z², which only their mean counts for.

    The likeliest place of a law without skew is not the mean of noise that has one: there a bias gains that is none.
    """
    z = residuals.range_z
    return sample.share * residuals.matched * (student(z) + 0.5 * np.minimum(z**2, sample.settings.law.most_squared))


def _quasi_likelihood(sample: Sample, residuals: Residuals) -> np.ndarray:
    """(n,) −½d² − log σ of each beam, d the difference from its neighbour over σ√2 (Wedderburn, Biometrika 1974).

    Its maximum is the standard deviation of the noise, whatever law that follows; the likelihood of a Student-t has it
    elsewhere for noise that is none.
    """
    pair = np.maximum(sample.partner, 0)
    found = np.zeros(len(sample))
    for z, clean, sigma in (
        (residuals.range_z, residuals.matched, residuals.range_sigma_m),
        (residuals.intensity_z, residuals.bright * residuals.whole * ~sample.seam, residuals.intensity_sigma),
    ):
        both = sample.share * clean * clean[pair] * (sample.partner >= 0)
        gap = np.minimum((z - z[pair]) ** 2 / 2, sample.settings.law.most_squared)
        found += both * (-0.5 * gap - np.log(np.maximum(sigma, 1e-9)))
    return found
