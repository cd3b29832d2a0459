"""Means of residuals in bins of a covariate, with bands that know that beams of one part of a frame share errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats


@dataclass(frozen=True, eq=False)
class Binned:
    """A residual by bins of a covariate.

    Attributes:
        bin: (k,) numbers of the bins that hold rows enough.
        place: (k,) mean of the covariate in the bin, or its category.
        mean, half: (k,) mean residual and half its 95 % interval; NaN half where one cluster alone is there.
        count: (k,) rows.
        strength: standard deviation of the true means over rows, what chance makes of it taken off.
        size: root mean square of the true means, of which the common one is a part, chance taken off.
        p_value: that the mean farthest from 0, in its own standard errors, is chance, all bins counted (Bonferroni).
    """

    bin: np.ndarray
    place: np.ndarray
    mean: np.ndarray
    half: np.ndarray
    count: np.ndarray
    strength: float
    size: float
    p_value: float


def quantile_edges(values: np.ndarray, bins: int) -> np.ndarray:
    """Inner edges so that each bin holds about as many rows; equal values share a bin."""
    return np.unique(np.quantile(values, np.linspace(0, 1, bins + 1)[1:-1]))


def binned(
    values: np.ndarray,
    bin_of: np.ndarray,
    residual: np.ndarray,
    cluster: np.ndarray,
    coverage: float = 0.95,
    fewest: int = 50,
) -> Binned:
    """Bin a residual; rows where it is NaN are left out, and bins with few rows.

    The variance of a bin's mean is that of sums over clusters (Liang and Zeger, Biometrika 1986), and at least that
    of independent rows.

    Args:
        values: (n,) covariate.
        bin_of: (n,) bin numbers from 0.
        residual: (n,).
        cluster: (n,) numbers from 0 of what shares errors.
        coverage: of intervals.
        fewest: rows of a bin that is told.
    """
    good = np.isfinite(residual)
    values, bin_of, cluster = values[good].astype(float), bin_of[good].astype(int), cluster[good].astype(int)
    residual = residual[good].astype(float)
    bins, clusters = int(bin_of.max(initial=0)) + 1, int(cluster.max(initial=0)) + 1
    count = np.bincount(bin_of, minlength=bins)
    whole = np.maximum(count, 1)
    mean = np.bincount(bin_of, residual, bins) / whole
    place = np.bincount(bin_of, values, bins) / whole
    away = residual - mean[bin_of]
    sums = np.bincount(bin_of * clusters + cluster, away, bins * clusters).reshape(bins, clusters)
    seen = (np.bincount(bin_of * clusters + cluster, minlength=bins * clusters).reshape(bins, clusters) > 0).sum(1)
    freedom = np.maximum(seen - 1, 1)
    clustered = (sums**2).sum(1) * seen / freedom / whole**2
    alone = np.bincount(bin_of, away**2, bins) / whole / np.maximum(count - 1, 1)
    variance = np.maximum(clustered, alone)
    half = np.where(seen > 1, np.sqrt(variance) * stats.t.ppf((1 + coverage) / 2, freedom), np.nan)
    kept = np.flatnonzero(count >= fewest)
    if not len(kept):
        return Binned(*(np.zeros(0) for _ in range(5)), strength=0.0, size=0.0, p_value=1.0)
    weight = count[kept] / count[kept].sum()
    level = float(weight @ mean[kept])
    strength, size = (
        float(np.sqrt(max(weight @ ((mean[kept] - middle) ** 2 - variance[kept]), 0.0))) for middle in (level, 0.0)
    )
    told = kept[(seen[kept] > 1) & (variance[kept] > 0)]
    chance = 2 * stats.t.sf(np.abs(mean[told]) / np.sqrt(variance[told]), freedom[told])
    p_value = min(len(told) * float(chance.min(initial=1.0)), 1.0)
    return Binned(kept, place[kept], mean[kept], half[kept], count[kept], strength, size, p_value)
