"""Checks of p-values and sets against what they promise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats


def uniformity(p_values: Sequence[float] | np.ndarray) -> float:
    """p-value of the Kolmogorov–Smirnov test that p-values are uniform."""
    return float(stats.kstest(np.asarray(p_values), "uniform").pvalue)


def excess(p_values: Sequence[float] | np.ndarray, level: float) -> float:
    """p-value of the hypothesis that at most a share `level` of p-values is at or below it (exact binomial test)."""
    rejected = int((np.asarray(p_values) <= level).sum())
    return float(stats.binomtest(rejected, len(p_values), level, alternative="greater").pvalue)


def upper_share(events: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """A share, and its one-sided lower confidence bound (Clopper and Pearson 1934)."""
    low = stats.beta.ppf(1 - confidence, events, trials - events + 1) if events else 0.0
    return events / trials, float(low)


def lower_share(events: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """A share, and its one-sided upper confidence bound."""
    high = stats.beta.ppf(confidence, events + 1, trials - events) if events < trials else 1.0
    return events / trials, float(high)
