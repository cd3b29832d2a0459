"""Assign detections to objects as the devkit does: greedily in the order of the label file, frame by frame.

The devkit's loops over objects are vectorised over all frames and score thresholds: first the first objects of all
frames, then the second ones, and so on. The candidates of each object are sorted by preference, so that it takes the
first one that is still free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from training.evaluation.candidates import Pairs
from training.evaluation.read import Scored

_CELLS = 8_000_000  # booleans of thresholds × detections held at a time


@dataclass(frozen=True, eq=False)
class Task:
    """One class, metric and difficulty.

    Attributes:
        scored: the frames.
        pairs: overlapping pairs of rows.
        object_counts: (g,) bool of all label rows: of the class, and within the difficulty.
        valid: (d,) bool of all detection rows: of the class, and tall enough. Other detections in `pairs` are too
            small: they may take an object, which is then neither hit nor miss.
        absorbed: (d,) bool: detections in a DontCare region, which are no false positives.
    """

    scored: Scored
    pairs: Pairs
    object_counts: np.ndarray
    valid: np.ndarray
    absorbed: np.ndarray

    @property
    def score(self) -> np.ndarray:
        """(d,) float64 scores of all detection rows."""
        score = self.scored.detections.objects.score
        return np.zeros(len(self.valid)) if score is None else score


@dataclass(frozen=True, eq=False)
class Counts:
    """Counts by score threshold, each (t, 1) float64 in all, or (t, f) by frame.

    Attributes:
        tp, fp, fn: hits, false positives, misses.
        similarity: sum of (1 + cos Δα) / 2 over the hits.
    """

    tp: np.ndarray
    fp: np.ndarray
    fn: np.ndarray
    similarity: np.ndarray

    def of_frames(self, weights: np.ndarray) -> Counts:
        """Weighted sums (t, 1) over frames."""
        return Counts(*((getattr(self, name) @ weights)[:, None] for name in _COUNTS))


_COUNTS = ("tp", "fp", "fn", "similarity")


def hit_scores(task: Task) -> tuple[np.ndarray, np.ndarray]:
    """Scores of the true positives when each object takes its highest-scoring candidate; and their frames."""
    order = np.lexsort((task.pairs.detection, -task.score[task.pairs.detection], task.pairs.label))
    taken = _assign(task, order, np.full(1, -np.inf))[0]
    hits = _hits(task, taken)
    return task.score[taken[hits]], task.scored.labels.frame[hits]


def assign_detections(task: Task, thresholds: np.ndarray) -> np.ndarray:
    """Detection assigned to each object at each threshold: (t, g) row of a detection, −1 none."""
    small = ~task.valid[task.pairs.detection]
    preference = np.where(small, 0.0, -task.pairs.overlap)
    order = np.lexsort((task.pairs.detection, preference, small, task.pairs.label))
    return _assign(task, order, thresholds)


def count(task: Task, thresholds: np.ndarray, *, by_frame: bool = False) -> Counts:
    """Hits, false positives and misses where each object takes the candidate that overlaps it most."""
    step = max(1, _CELLS // max(len(task.valid) + len(task.object_counts), 1))
    parts = [_count(task, thresholds[start : start + step], by_frame) for start in range(0, len(thresholds), step)]
    empty = np.zeros((0, len(task.scored.names) if by_frame else 1))
    return Counts(*(np.concatenate([empty, *(getattr(part, name) for part in parts)]) for name in _COUNTS))


def _count(task: Task, thresholds: np.ndarray, by_frame: bool) -> Counts:
    labels, detections = task.scored.labels, task.scored.detections
    frames = len(task.scored.names) if by_frame else 1
    frame = labels.frame if by_frame else np.zeros_like(labels.frame)
    taken = assign_detections(task, thresholds)
    is_assigned = taken >= 0
    step, row = np.nonzero(is_assigned & task.object_counts)
    hit = task.valid[taken[step, row]]
    step, row = step[hit], row[hit]
    similarities = (1 + np.cos(labels.objects.alpha[row] - detections.objects.alpha[taken[step, row]])) / 2
    shape = (len(thresholds), frames)
    tp = _sum_by_cell(step, frame[row], shape)
    similarity = _sum_by_cell(step, frame[row], shape, similarities)
    missed_step, missed = np.nonzero(~is_assigned & task.object_counts)
    is_false_candidate = task.valid & ~task.absorbed
    used_step, used = np.nonzero(is_assigned)
    is_answer = is_false_candidate[taken[used_step, used]]
    fp = -_sum_by_cell(used_step[is_answer], frame[used[is_answer]], shape)
    rows = np.flatnonzero(is_false_candidate)
    if by_frame:
        scored_step, is_scored = np.nonzero(task.score[rows][None] >= thresholds[:, None])
        fp += _sum_by_cell(scored_step, detections.frame[rows[is_scored]], shape)
    else:
        fp += (len(rows) - np.searchsorted(np.sort(task.score[rows]), thresholds, "left"))[:, None]
    return Counts(tp, fp, _sum_by_cell(missed_step, frame[missed], shape), similarity)


def _sum_by_cell(
    step: np.ndarray, frame: np.ndarray, shape: tuple[int, int], weights: np.ndarray | None = None
) -> np.ndarray:
    cells = np.bincount(step * shape[1] + frame, weights, shape[0] * shape[1])
    return cells.reshape(shape).astype(np.float64)


def _hits(task: Task, taken: np.ndarray) -> np.ndarray:
    """Label rows with a valid detection."""
    rows = np.flatnonzero(task.object_counts & (taken >= 0))
    return rows[task.valid[taken[rows]]]


def _assign(task: Task, order: np.ndarray, thresholds: np.ndarray) -> np.ndarray:
    """(t, g) the row that each object takes, −1 none.

    Args:
        task: whose pairs.
        order: of the pairs: object by object, the best candidate first.
        thresholds: (t,) scores below which a detection does not exist.
    """
    label, detection = task.pairs.label[order], task.pairs.detection[order]
    taken = np.full((len(thresholds), len(task.object_counts)), -1)
    free = np.concatenate([task.score[None] >= thresholds[:, None], np.zeros((len(thresholds), 1), bool)], 1)
    objects, begin, counts = np.unique(label, return_index=True, return_counts=True)
    frame = task.scored.labels.frame[objects]
    order_in_frame = np.arange(len(objects)) - np.searchsorted(frame, frame)
    steps = np.arange(len(thresholds))[:, None]
    for number in range(order_in_frame.max(initial=-1) + 1):
        rows = np.flatnonzero(order_in_frame == number)
        positions = begin[rows, None] + np.arange(counts[rows].max())
        is_present = np.arange(counts[rows].max()) < counts[rows, None]
        candidates = np.where(is_present, detection[np.minimum(positions, len(detection) - 1)], free.shape[1] - 1)
        is_free = free[:, candidates]
        best = candidates[np.arange(len(rows)), is_free.argmax(-1)]
        is_assigned = is_free.any(-1)
        taken[:, objects[rows]] = np.where(is_assigned, best, -1)
        free[steps, np.where(is_assigned, best, free.shape[1] - 1)] = False
    return taken
