"""Average precision: as the devkit samples it at 41 scores, and the whole curve for small sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from training.evaluation.matching import Counts
from training.evaluation.rules import SAMPLES


@dataclass(frozen=True)
class Average:
    """Average precisions in percent: over 40 and over 11 recalls."""

    r40: float
    r11: float


def sample_thresholds(scores: np.ndarray, objects: float) -> np.ndarray:
    """The scores at which the devkit takes precision: about every fortieth of the recall.

    Args:
        scores: of the true positives.
        objects: how many there are to find.

    Returns:
        At most 41 scores, descending.
    """
    scores = np.sort(scores)[::-1]
    chosen: list[float] = []
    current, last = 0.0, len(scores) - 1
    for row, score in enumerate(scores.tolist()):
        left = (row + 1) / objects
        right = (row + 2) / objects if row < last else left
        if right - current < current - left and row < last:
            continue
        chosen.append(score)
        current += 1.0 / (SAMPLES - 1.0)
    return np.array(chosen[:SAMPLES])


def sampled_average(amount: np.ndarray, answers: np.ndarray) -> Average:
    """AP (or AOS, with the summed likeness as amount) from its value at each threshold.

    Args:
        amount: (≤ 41,) true positives, or their summed similarity.
        answers: (≤ 41,) true and false positives.
    """
    samples = np.zeros(SAMPLES)
    samples[: len(amount)] = np.divide(amount, answers, out=np.zeros(len(amount)), where=answers > 0)
    samples = np.maximum.accumulate(samples[::-1])[::-1]
    return Average(float(100 * samples[1:].sum() / (SAMPLES - 1)), float(100 * samples[::4].sum() / 11))


def whole_curve(counts: Counts) -> tuple[np.ndarray, np.ndarray]:
    """Recall and precision (t,) at each threshold, of counts summed over frames (t, 1)."""
    tp, fp, fn = counts.tp[:, 0], counts.fp[:, 0], counts.fn[:, 0]
    recall = np.divide(tp, tp + fn, out=np.zeros_like(tp), where=tp + fn > 0)
    return recall, np.divide(tp, tp + fp, out=np.zeros_like(tp), where=tp + fp > 0)


def continuous_average(recall: np.ndarray, precision: np.ndarray) -> float:
    """Area [%] under the precision that is reached at a recall or beyond; thresholds in descending order.

    Unlike the sampled averages it is 100 for a perfect detector on any number of objects.
    """
    if not len(recall):
        return 0.0
    order = np.argsort(recall, kind="stable")
    reached = np.maximum.accumulate(precision[order][::-1])[::-1]
    return float(100 * np.sum(np.diff(recall[order], prepend=0.0) * reached))
