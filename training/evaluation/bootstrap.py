"""Sampling variation of a figure: bootstrap over whole frames.

Objects of one frame are dependent, so frames are resampled, not objects (Efron & Tibshirani, An Introduction to the
Bootstrap, 1993, chapters 6 and 13). Two results on the same frames, resampled with equal seeds, may be subtracted
draw by draw.
"""

from __future__ import annotations

import numpy as np

from training.evaluation.average_precision import (
    continuous_average,
    sample_thresholds,
    sampled_average,
    whole_curve,
)
from training.evaluation.evaluate import Result, curve_thresholds
from training.evaluation.matching import count

_MOST_THRESHOLDS = 400  # maximum number of candidate thresholds


def resample(result: Result, rng: np.random.Generator, draws: int = 1000) -> np.ndarray:
    """R40 and continuous AP [%] of sets drawn from the frames with replacement, (draws, 2) float64."""
    frames = len(result.task.scored.names)
    thresholds = curve_thresholds(result.hit_scores, _MOST_THRESHOLDS)
    counts = count(result.task, thresholds, by_frame=True)
    labels = result.task.scored.labels
    objects = np.bincount(labels.frame[result.task.object_counts], minlength=frames)
    values = np.zeros((draws, 2))
    for draw in range(draws):
        times = np.bincount(rng.integers(0, frames, frames), minlength=frames)
        scores = np.repeat(result.hit_scores, times[result.hit_frames])
        if not len(scores):
            continue
        summed = counts.of_frames(times)
        slots = np.searchsorted(-thresholds, -sample_thresholds(scores, float(objects @ times)))
        slots = np.minimum(slots, len(thresholds) - 1)
        tp, fp = summed.tp[slots, 0], summed.fp[slots, 0]
        values[draw] = sampled_average(tp, tp + fp).r40, continuous_average(*whole_curve(summed))
    return values


def interval(values: np.ndarray, level: float = 0.95) -> tuple[float, float]:
    """Central interval that contains a share `level` of the draws (n,)."""
    low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
