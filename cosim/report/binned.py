"""Mean residuals in bins of a covariate, with cluster-robust confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats


@dataclass(frozen=True, eq=False)
class Binned:
    """Residual statistics by bins of a covariate.

    Attributes:
        bin: (k,) numbers of the bins with enough rows.
        place: (k,) mean of the covariate in the bin, or its category.
        mean, half: (k,) mean residual and half the width of its confidence interval; NaN for bins with one cluster.
        count: (k,) number of rows.
        strength: standard deviation of the bin means between bins, corrected for sampling noise.
        size: root mean square of the bin means, corrected for sampling noise.
        p_value: smallest p-value of the bin means, Bonferroni-corrected for the number of bins.
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
    """Inner edges of bins with about equal numbers of rows; equal values are in the same bin."""
    return np.unique(np.quantile(values, np.linspace(0, 1, bins + 1)[1:-1]))


def binned(
    values: np.ndarray,
    bin_of: np.ndarray,
    residual: np.ndarray,
    cluster: np.ndarray,
    coverage: float = 0.95,
    fewest: int = 50,
) -> Binned:
    """Bin a residual; rows with NaN residual and bins with few rows are skipped.

    The variance of a bin's mean is cluster-robust (Liang and Zeger, Biometrika 1986), and at least that of independent
    rows.

    Args:
        values: (n,) covariate.
        bin_of: (n,) bin numbers from 0.
        residual: (n,) residual; NaN is skipped.
        cluster: (n,) cluster numbers from 0; rows of one cluster may have correlated errors.
        coverage: coverage of the confidence intervals.
        fewest: minimum number of rows of a bin.
    """
    good = np.isfinite(residual)
    values, bin_of, cluster = values[good].astype(float), bin_of[good].astype(int), cluster[good].astype(int)
    residual = residual[good].astype(float)
    bins, clusters = int(bin_of.max(initial=0)) + 1, int(cluster.max(initial=0)) + 1
    count = np.bincount(bin_of, minlength=bins)
    divisor = np.maximum(count, 1)
    mean = np.bincount(bin_of, residual, bins) / divisor
    position = np.bincount(bin_of, values, bins) / divisor
    centred = residual - mean[bin_of]
    cell = bin_of * clusters + cluster
    sums = np.bincount(cell, centred, bins * clusters).reshape(bins, clusters)
    present = (np.bincount(cell, minlength=bins * clusters).reshape(bins, clusters) > 0).sum(1)
    freedom = np.maximum(present - 1, 1)
    clustered = (sums**2).sum(1) * present / freedom / divisor**2
    independent = np.bincount(bin_of, centred**2, bins) / divisor / np.maximum(count - 1, 1)
    variance = np.maximum(clustered, independent)
    half = np.where(present > 1, np.sqrt(variance) * stats.t.ppf((1 + coverage) / 2, freedom), np.nan)
    kept = np.flatnonzero(count >= fewest)
    if not len(kept):
        return Binned(*(np.zeros(0) for _ in range(5)), strength=0.0, size=0.0, p_value=1.0)
    weight = count[kept] / count[kept].sum()
    level = float(weight @ mean[kept])
    strength, size = (
        float(np.sqrt(max(weight @ ((mean[kept] - middle) ** 2 - variance[kept]), 0.0))) for middle in (level, 0.0)
    )
    tested = kept[(present[kept] > 1) & (variance[kept] > 0)]
    p_values = 2 * stats.t.sf(np.abs(mean[tested]) / np.sqrt(variance[tested]), freedom[tested])
    p_value = min(len(tested) * float(p_values.min(initial=1.0)), 1.0)
    return Binned(kept, position[kept], mean[kept], half[kept], count[kept], strength, size, p_value)
