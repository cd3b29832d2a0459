"""KITTI's object benchmark on the CPU: every class, metric and difficulty."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from cosim.drives.kitti import Labels
from cosim.drives.kitti.labels import truncation_doubt
from training.evaluation.average_precision import (
    continuous_average,
    sample_thresholds,
    sampled_average,
    whole_curve,
)
from training.evaluation.candidates import Pairs, absorbed, overlapping
from training.evaluation.comparable import (
    demand_comparable_classes,
    has_image_boxes,
    heights,
    without_image_rules,
)
from training.evaluation.matching import Task, count, hit_scores
from training.evaluation.read import Scored
from training.evaluation.rules import (
    CLASSES,
    DIFFICULTIES,
    MAX_OCCLUSION,
    MAX_TRUNCATION,
    METRICS,
    MIN_HEIGHT_PX,
    MIN_OVERLAP,
    NEIGHBOURS,
    NO_ALPHA,
    Metric,
)

_CURVE_POINTS = 200  # thresholds of a curve at most; with fewer hits the curve is exact


@dataclass(frozen=True, eq=False)
class Result:
    """A class scored by a metric at a difficulty; averages in percent.

    Attributes:
        r40, r11: the devkit's averages.
        aos40, aos11: the same of orientation similarity.
        continuous: the area under the whole curve.
        thresholds: (t,) scores of the whole curve, descending: those of all hits, or 200 evenly spaced ones.
        recall, precision: (t,) the curve.
        hit_scores, hit_frames: (h,) scores and frames of the hits that define the thresholds.
        task: what was scored.
    """

    r40: float
    r11: float
    aos40: float
    aos11: float
    continuous: float
    thresholds: np.ndarray
    recall: np.ndarray
    precision: np.ndarray
    hit_scores: np.ndarray
    hit_frames: np.ndarray
    task: Task

    def text(self, average: str) -> str:
        """One of the averages, such as `r40`, in percent; a dash if there was no object to find."""
        return f"{getattr(self, average):.2f}" if self.task.object_counts.sum() else "–"


@dataclass(frozen=True, eq=False)
class Evaluation:
    """All results.

    Attributes:
        scored: what was evaluated.
        results: by class, metric and difficulty; a metric is absent if the detections have no such boxes, a
            class if it has no detections.
        oriented: whether all detections contain alpha, which AOS requires.
        notes: by class, how the difficulty was determined where KITTI's rules cannot be applied.
    """

    scored: Scored
    results: dict[str, dict[Metric, list[Result]]] = field(default_factory=dict)
    oriented: bool = True
    notes: dict[str, str] = field(default_factory=dict)


def evaluate(
    scored: Scored,
    *,
    classes: Sequence[str] = CLASSES,
    overlaps: dict[str, float] = MIN_OVERLAP,
    points: np.ndarray | None = None,
    on_part: Callable[[], None] = lambda: None,
) -> Evaluation:
    """Score detections as KITTI's C++ devkit does; classes without image boxes by 3D and bird's-eye boxes only.

    Args:
        scored: labels and detections.
        classes: those to score.
        overlaps: least intersection over union by class, exclusive.
        points: (g,) scan points in the box of each label, if known; used where there are no image boxes.
        on_part: called after every class and metric.
    """
    oriented = not (scored.detections.objects.alpha == NO_ALPHA).any()
    evaluation = Evaluation(scored, oriented=oriented)
    demand_comparable_classes(scored, classes)
    for name in classes:
        metrics = _available_metrics(scored, name)
        results = {}
        for metric in METRICS:
            if metric in metrics:
                results[metric] = [_score(task) for task in tasks(scored, name, metric, overlaps[name], points)]
            on_part()
        if results:
            evaluation.results[name] = results
            notes = _notes(scored, name, metrics, points is not None)
            if notes:
                evaluation.notes[name] = "; ".join(notes)
    return evaluation


def _notes(scored: Scored, name: str, metrics: set[Metric], has_points: bool) -> list[str]:
    """How a class's scores differ from those by KITTI's rules."""
    notes = []
    if not has_image_boxes(scored, name):
        notes.append(without_image_rules(has_points))
    elif not {"3d", "bev"} & metrics:
        notes.append("labels or detections have no 3D boxes: only boxes in the image are scored")
    doubt = truncation_doubt(scored.labels.objects.truncated, scored.labels.objects.bbox)
    if doubt:
        notes.append(doubt)
    return notes


def tasks(scored: Scored, name: str, metric: Metric, above: float, points: np.ndarray | None = None) -> list[Task]:
    """A class and metric at the three difficulties.

    Args:
        scored: labels and detections.
        name: of the class.
        metric: one of `METRICS`.
        above: least overlap, exclusive.
        points: (g,) scan points in the box of each label, if known; used where there are no image boxes.
    """
    objects = scored.labels.objects
    truncation = objects.truncation
    of_class = scored.labels.kind == name.lower()
    neighbour = scored.labels.kind == (NEIGHBOURS[name] or "").lower()
    detected = scored.detections.kind == name.lower()
    height, detection_height, has_points = heights(scored, name, points)
    candidates = np.flatnonzero(detected | (detection_height < max(MIN_HEIGHT_PX)))
    pairs = overlapping(scored, np.flatnonzero(of_class | neighbour), candidates, metric, above)
    absorbed_rows = np.zeros(len(detected), bool)
    if metric == "2d":
        absorbed_rows[candidates] = absorbed(scored, candidates, above)
    task_list = []
    for level in range(len(DIFFICULTIES)):
        easy_enough = (objects.occluded <= MAX_OCCLUSION[level]) & (truncation <= MAX_TRUNCATION[level])
        counts = of_class & easy_enough & (height > MIN_HEIGHT_PX[level]) & has_points
        small = detection_height < MIN_HEIGHT_PX[level]
        kept = (detected | small)[pairs.detection]
        kept_pairs = Pairs(pairs.label[kept], pairs.detection[kept], pairs.overlap[kept])
        task_list.append(Task(scored, kept_pairs, counts, detected & ~small, absorbed_rows))
    return task_list


def _available_metrics(scored: Scored, name: str) -> set[Metric]:
    """The metrics that the devkit evaluates: those that a detection of the class has boxes for.

    Metrics that no label of the class has boxes for are not scored either, as their score would be zero.
    """
    detections = scored.detections.objects
    of_class = scored.detections.kind == name.lower()
    labelled = scored.labels.kind == name.lower()
    rows_by_metric: dict[Metric, np.ndarray] = {
        "2d": of_class & (detections.bbox[:, 0] >= 0) & has_image_boxes(scored, name),
    }
    for metric, boxes in _solid_boxes(detections).items():
        are_labelled = not labelled.any() or bool(_solid_boxes(scored.labels.objects)[metric][labelled].any())
        rows_by_metric[metric] = of_class & boxes & are_labelled
    return {metric for metric, rows in rows_by_metric.items() if rows.any()}


def _solid_boxes(objects: Labels) -> dict[Metric, np.ndarray]:
    """(n,) bool objects that have a box in bird's-eye view, and in 3D."""
    height, width, length = objects.dimensions.T
    ground = (objects.location[:, 0] != -1000) & (objects.location[:, 2] != -1000) & (width > 0) & (length > 0)
    return {"bev": ground, "3d": ground & (objects.location[:, 1] != -1000) & (height > 0)}


def _score(task: Task) -> Result:
    scores, frames = hit_scores(task)
    sampled = count(task, sample_thresholds(scores, task.object_counts.sum()))
    answers = (sampled.tp + sampled.fp)[:, 0]
    average = sampled_average(sampled.tp[:, 0], answers)
    similarity = sampled_average(sampled.similarity[:, 0], answers)
    thresholds = curve_thresholds(scores)
    recall, precision = whole_curve(count(task, thresholds))
    area = continuous_average(recall, precision)
    averages = (average.r40, average.r11, similarity.r40, similarity.r11, area)
    return Result(*averages, thresholds, recall, precision, scores, frames, task)


def curve_thresholds(scores: np.ndarray, most: int = _CURVE_POINTS) -> np.ndarray:
    """Distinct scores of hits, descending; at most `most`, evenly spaced."""
    distinct = np.unique(scores)[::-1]
    if len(distinct) > most:
        distinct = distinct[np.linspace(0, len(distinct) - 1, most).round().astype(int)]
    return distinct
