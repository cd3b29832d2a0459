"""Classify the errors of detections, and correct selected error types.

The error types are those of TIDE (Bolya, Foley, Hays & Hoffman, "TIDE: A General Toolbox for Identifying Object
Detection Errors", ECCV 2020, section 2.2), with its localisation error split into the parts of an upright box. Every
detection that counts belongs to the object it overlaps most from above, if by more than 0.1. One of the detections of
an object is its box, the others are duplicates. A detection without object is a false alarm, or a box on an object of
another class. An object without detection is missed.

Correcting an error type removes its errors and leaves everything else, including scores, unchanged: false alarms, boxes
on other classes and duplicates are removed, missed objects are no longer counted, and the position, height, size or
heading of each box is replaced by that of the object. A part is corrected only if this increases the overlap: a box
that is too short and matches the visible face would become worse if only its centre were corrected.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cosim.drives.kitti import Labels
from training.evaluation.candidates import Pairs, overlapping, paired_overlaps
from training.evaluation.evaluate import tasks
from training.evaluation.matching import Task
from training.evaluation.read import Scored
from training.evaluation.rules import MIN_OVERLAP, NEIGHBOURS, Metric

#: Error types of boxes, and other error types.
BOX_PARTS: dict[Metric, tuple[str, ...]] = {
    "3d": ("position", "height", "size", "heading"),
    "bev": ("position", "size", "heading"),
}
OTHER_KINDS = ("misses", "false_alarms", "other_class", "duplicates")
#: Overlap from above over which a detection belongs to an object (TIDE's background threshold).
BELONGS = 0.1


@dataclass(frozen=True, eq=False)
class Faults:
    """Errors of the detections of one class, metric and difficulty.

    Attributes:
        task: objects and detections to score.
        metric: 3D or bird's-eye view.
        owner: (d,) int64 of all detection rows: the object it belongs to, −1 none.
        box: (g,) int64 of all label rows: the detection that is the object's box, −1 none.
        missed: (g,) bool: objects that count and have no detection.
        false_alarms, other_class, duplicates: (d,) bool of all detection rows that count.
        overlap: for each set of corrected parts of a box, (g,) float64: overlap of the objects' boxes; 0
            without box.
        above: required overlap of a hit, exclusive.
    """

    task: Task
    metric: Metric
    owner: np.ndarray
    box: np.ndarray
    missed: np.ndarray
    false_alarms: np.ndarray
    other_class: np.ndarray
    duplicates: np.ndarray
    overlap: dict[frozenset[str], np.ndarray]
    above: float

    @property
    def error_types(self) -> tuple[str, ...]:
        """All error types of this metric."""
        return (*BOX_PARTS[self.metric], *OTHER_KINDS)

    @property
    def misfits(self) -> np.ndarray:
        """(g,) bool: objects with a box that overlaps too little."""
        return (self.box >= 0) & (self.overlap[frozenset()] <= self.above)

    def corrected(
        self, error_types: Collection[str], objects: np.ndarray | None = None, among: np.ndarray | None = None
    ) -> Task:
        """Return the task with some error types corrected.

        Args:
            kinds: error types to correct.
            objects: (g,) bool, objects whose errors are corrected; all by default.
            among: (d,) bool, detections without object that are corrected; all by default.
        """
        task, pairs = self.task, self.task.pairs
        selected = np.ones(len(self.box), bool) if objects is None else objects
        valid = task.valid.copy()
        for kind in ("false_alarms", "other_class"):
            if kind in error_types:
                valid &= ~(getattr(self, kind) if among is None else getattr(self, kind) & among)
        if "duplicates" in error_types:
            valid &= ~(self.duplicates & np.append(selected, False)[self.owner])
        kept = valid[pairs.detection] | ~task.valid[pairs.detection]  # detections too small to count are kept
        parts = frozenset(error_types) & frozenset(BOX_PARTS[self.metric])
        fitted = Pairs(pairs.label[kept], pairs.detection[kept], pairs.overlap[kept])
        if parts:
            fitted = self._with_boxes(fitted, parts, selected)
        counts = task.object_counts & ~(self.missed & selected) if "misses" in error_types else task.object_counts
        return replace(task, pairs=fitted, object_counts=counts, valid=valid)

    def _with_boxes(self, pairs: Pairs, parts: frozenset[str], objects: np.ndarray) -> Pairs:
        """Replace the pairs of objects with their corrected boxes."""
        rows = np.flatnonzero((self.box >= 0) & objects & (self.overlap[parts] > self.above))
        is_box = self.box[pairs.label] == pairs.detection
        keep = ~(is_box & np.isin(pairs.label, rows))
        label = np.concatenate([pairs.label[keep], rows])
        detection = np.concatenate([pairs.detection[keep], self.box[rows]])
        overlap = np.concatenate([pairs.overlap[keep], self.overlap[parts][rows]])
        order = np.lexsort((detection, label))
        return Pairs(label[order], detection[order], overlap[order])


def find_faults(scored: Scored, name: str, metric: Metric, level: int = 1) -> Faults:
    """Classify the errors of the detections of a class.

    Args:
        scored: labels and detections.
        name: the class.
        metric: `3d` or `bev`.
        level: 0 easy, 1 moderate, 2 hard.
    """
    above = MIN_OVERLAP[name]
    task = tasks(scored, name, metric, above)[level]
    is_candidate = np.isin(scored.labels.kind, [name.lower(), (NEIGHBOURS[name] or name).lower()])
    owner = _assign_owners(task, is_candidate)
    box = _select_boxes(task, owner)
    others = np.flatnonzero((scored.labels.kind != "dontcare") & ~is_candidate)
    unassigned = task.valid & (owner < 0)
    on_others = overlapping(scored, others, np.flatnonzero(unassigned), "bev", BELONGS).detection
    other_class = np.isin(np.arange(len(owner)), on_others)
    is_box = np.isin(np.arange(len(owner)), box[box >= 0])
    return Faults(
        task=task,
        metric=metric,
        owner=owner,
        box=box,
        missed=task.object_counts & (box < 0),
        false_alarms=unassigned & ~other_class,
        other_class=other_class,
        duplicates=task.valid & (owner >= 0) & ~is_box,
        overlap=_overlaps_by_parts(scored, box, metric),
        above=above,
    )


def _assign_owners(task: Task, is_candidate: np.ndarray) -> np.ndarray:
    """Object with the largest bird's-eye overlap for each detection that counts, (d,) int64; −1 none.

    Args:
        task: what is scored.
        looked_for: (g,) bool: objects of the class or a neighbouring one, whether they count or not.
    """
    pairs = overlapping(task.scored, np.flatnonzero(is_candidate), np.flatnonzero(task.valid), "bev", BELONGS)
    owner = np.full(len(task.valid), -1)
    order = np.argsort(pairs.overlap, kind="stable")
    owner[pairs.detection[order]] = pairs.label[order]  # the largest overlap is written last
    return owner


def _select_boxes(task: Task, owner: np.ndarray) -> np.ndarray:
    """Box of each object: the hit, otherwise the detection, with the highest score; (g,), −1 none."""
    is_hit = np.zeros(len(owner), bool)
    is_own = owner[task.pairs.detection] == task.pairs.label
    is_hit[task.pairs.detection[is_own]] = True
    rows = np.flatnonzero(owner >= 0)
    rows = rows[np.lexsort((-rows, task.score[rows], is_hit[rows]))]
    box = np.full(len(task.object_counts), -1)
    box[owner[rows]] = rows  # the best is written last
    return box


def _overlaps_by_parts(scored: Scored, box: np.ndarray, metric: Metric) -> dict[frozenset[str], np.ndarray]:
    """Overlap of boxes with their objects for each set of corrected parts: the maximum over its subsets."""
    rows = np.flatnonzero(box >= 0)
    truth, detected = scored.labels.objects[rows], scored.detections.objects[box[rows]]
    best: dict[frozenset[str], np.ndarray] = {}
    for parts in subsets(BOX_PARTS[metric]):
        overlap = np.zeros(len(box))
        overlap[rows] = paired_overlaps(truth, with_parts(detected, truth, parts), metric)
        for part in parts:
            overlap = np.maximum(overlap, best[parts - {part}])
        best[parts] = overlap
    return best


def with_parts(detected: Labels, truth: Labels, parts: Collection[str]) -> Labels:
    """Replace parts of boxes by those of other boxes, row by row; a change of size keeps the centre."""
    source = {part: truth if part in parts else detected for part in ("position", "height", "size", "heading")}
    dimensions = source["size"].dimensions
    location = source["position"].location.copy()
    middle = source["height"].location[:, 1] - source["height"].dimensions[:, 0] / 2
    location[:, 1] = middle + dimensions[:, 0] / 2
    return replace(detected, dimensions=dimensions, location=location, rotation_y=source["heading"].rotation_y)


def subsets(error_types: Sequence[str]) -> list[frozenset[str]]:
    """All subsets, smaller ones first."""
    return [frozenset(chosen) for count in range(len(error_types) + 1) for chosen in combinations(error_types, count)]
