"""Means of residuals in bins of a covariate, with bands that know that beams of one frame share errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

_FEWEST = 50
_LEVEL = 0.975


@dataclass(frozen=True, eq=False)
class Binned:
    """A residual by bins of a covariate.

    Attributes:
        place: (k,) mean of the covariate in the bin, or its category.
        mean, half: (k,) mean residual and half its 95 % interval; NaN half where one frame alone is there.
        count: (k,) rows.
        strength: standard deviation of the true means over rows, what chance makes of it taken off.
        apparent: the same if rows were independent: differences that may be those of frames.
    """

    place: np.ndarray
    mean: np.ndarray
    half: np.ndarray
    count: np.ndarray
    strength: float
    apparent: float


def in_quantiles(values: np.ndarray, bins: int) -> np.ndarray:
    """Bin numbers (n,) so that each bin holds about as many rows; equal values share a bin."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, bins + 1)[1:-1]))
    return np.searchsorted(edges, values, side="right")


def binned(values: np.ndarray, bin_of: np.ndarray, residual: np.ndarray, frame: np.ndarray) -> Binned:
    """Bin a residual; rows where it is NaN are left out, and bins with few rows.

    The variance of a bin's mean is that of sums over frames (Liang and Zeger, Biometrika 1986), and at least that
    of independent rows.

    Args:
        values: (n,) covariate.
        bin_of: (n,) bin numbers from 0.
        residual: (n,).
        frame: (n,) cluster numbers from 0.
    """
    good = np.isfinite(residual)
    values, bin_of, frame = values[good].astype(float), bin_of[good].astype(int), frame[good].astype(int)
    residual = residual[good].astype(float)
    bins, frames = int(bin_of.max(initial=0)) + 1, int(frame.max(initial=0)) + 1
    count = np.bincount(bin_of, minlength=bins)
    whole = np.maximum(count, 1)
    mean = np.bincount(bin_of, residual, bins) / whole
    place = np.bincount(bin_of, values, bins) / whole
    away = residual - mean[bin_of]
    sums = np.bincount(bin_of * frames + frame, away, bins * frames).reshape(bins, frames)
    seen = (np.bincount(bin_of * frames + frame, minlength=bins * frames).reshape(bins, frames) > 0).sum(1)
    freedom = np.maximum(seen - 1, 1)
    clustered = (sums**2).sum(1) * seen / freedom / whole**2
    alone = np.bincount(bin_of, away**2, bins) / whole / np.maximum(count - 1, 1)
    variance = np.maximum(clustered, alone)
    half = np.where(seen > 1, np.sqrt(variance) * stats.t.ppf(_LEVEL, freedom), np.nan)
    kept = count >= _FEWEST
    if not kept.any():
        return Binned(*(np.zeros(0) for _ in range(4)), strength=0.0, apparent=0.0)
    weight = count[kept] / count[kept].sum()
    away2 = (mean[kept] - float(weight @ mean[kept])) ** 2
    strength, apparent = (float(np.sqrt(max(weight @ (away2 - one[kept]), 0.0))) for one in (variance, alone))
    return Binned(place[kept], mean[kept], half[kept], count[kept], strength, apparent)
