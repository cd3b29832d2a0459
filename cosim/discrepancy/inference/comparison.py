"""How much better one model is than another on the same beams: one comparison for everything that may be added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from cosim.discrepancy.inference.fit import Fitted, Fitter


@dataclass(frozen=True, eq=False)
class Gain:
    """A difference of log-likelihoods by cluster.

    Attributes:
        value: of the whole sample, whose beams weigh one on average.
        error: its standard error, from cluster to cluster.
        clusters: how many of them differ.
    """

    value: float
    error: float
    clusters: int

    @property
    def p_value(self) -> float:
        """One-sided, of a t-test that there is none."""
        if self.error <= 0 or self.clusters < 2:
            return 1.0
        return float(stats.t.sf(self.value / self.error, self.clusters - 1))


def gain(fitter: Fitter, before: Fitted, after: Fitted, *, of_noise: bool = False) -> Gain:
    """Gain of one fit over another, random effects with their laws.

    The gain per beam does not depend on how many beams were drawn; its error is of clusters: objects, cells of the
    map, and scans, whatever their number of beams.

    Args:
        fitter: of the sample that both are of.
        before, after: fits, or models as they are with random effects fitted.
        of_noise: hold spreads against how neighbours differ instead, which no misfit of the mean enters: the
            quasi-likelihood −½(d²/s² + log s²), consistent for any law of the noise (Wedderburn, Biometrika 1974).
    """
    clusters, sample = fitter.random.clusters, fitter.sample
    if of_noise:
        beams, law = _of_neighbours(fitter, after) - _of_neighbours(fitter, before), np.zeros(fitter.random.size)
    else:
        beams = sample.share * (after.fit.loglik - before.fit.loglik)
        law = _of_law(fitter, after) - _of_law(fitter, before)
    found = []
    for cluster, unit in (
        (clusters.track, clusters.unit_track),
        (clusters.part, np.full_like(clusters.unit_track, -1)),
    ):
        own = np.bincount(cluster, beams)
        rest = np.where(unit >= 0, 0.0, law)
        scans = np.bincount(np.maximum(clusters.unit_scan, 0), np.where(clusters.unit_scan >= 0, rest, 0.0))
        things = np.bincount(
            np.maximum(clusters.unit_track, 0), np.where((clusters.unit_track >= 0) & (unit < 0), rest, 0.0)
        )
        of_units = np.bincount(np.maximum(unit, 0), np.where(unit >= 0, law, 0.0), len(own))[: len(own)]
        parts = np.concatenate([own + of_units, scans, things])
        used = parts[parts != 0]
        spread = float(np.sqrt(np.sum((used - used.mean()) ** 2))) if len(used) else 0.0
        found.append(Gain(float(beams.sum() + law.sum()), spread, len(used)))
    return max(found, key=lambda one: one.error)


def _of_law(fitter: Fitter, fitted: Fitted) -> np.ndarray:
    """(m,) log-densities of the random effects under their laws, up to a constant."""
    active = fitter.random.active(fitted.estimate)
    precision = np.where(active, fitter.random.precision(fitted.estimate), 1.0)
    return np.where(active, -0.5 * fitted.estimate.u**2 * precision, 0.0)


def _of_neighbours(fitter: Fitter, fitted: Fitted) -> np.ndarray:
    sample, fit = fitter.sample, fitted.fit
    pair = np.maximum(sample.partner, 0)
    found = np.zeros(len(sample))
    for z, clean, sigma in (
        (fit.range_z, fit.matched, fit.range_sigma_m),
        (fit.intensity_z, fit.bright * fit.whole * ~sample.seam, fit.intensity_sigma),
    ):
        both = sample.share * clean * clean[pair] * (sample.partner >= 0)
        gap = np.minimum((z - z[pair]) ** 2 / 2, _MOST_SQUARED)
        found += both * (-0.5 * gap - np.log(np.maximum(sigma, 1e-9)))
    return found


_MOST_SQUARED = 100.0
