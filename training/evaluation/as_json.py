"""The result of an evaluation as JSON."""

from __future__ import annotations

from typing import Any

from training.evaluation.evaluate import Evaluation
from training.evaluation.rules import CLASSES, METRICS
from training.evaluation.slices import ScoreSlice

Intervals = dict[tuple[str, str], list[tuple[float, float]]]


def as_json(
    evaluation: Evaluation,
    intervals: Intervals | None = None,
    parts: dict[str, dict[str, list[ScoreSlice]]] | None = None,
) -> dict[str, Any]:
    """`{CLASS: {METRIC: {"R40": [easy, moderate, hard], "R11": […], "continuous": […]}, "aos": …}}` in percent.

    A class without detections is null, and so is a metric for which the detections have no boxes.
    `rules` describes how the difficulty was determined if the files have no image boxes; 2D and AOS are then null.
    `R40_ci95` and `slices` are included if they were computed.
    """
    return {name: _class_json(evaluation, name, intervals or {}, (parts or {}).get(name)) for name in CLASSES}


def _class_json(
    evaluation: Evaluation, name: str, intervals: Intervals, parts: dict[str, list[ScoreSlice]] | None
) -> dict[str, Any] | None:
    metrics = evaluation.results.get(name)
    if metrics is None:
        return None
    entry: dict[str, Any] = {}
    for metric in METRICS:
        levels = metrics.get(metric)
        entry[metric] = levels and {
            "R40": [result.r40 for result in levels],
            "R11": [result.r11 for result in levels],
            "continuous": [result.continuous for result in levels],
            "objects": [int(result.task.object_counts.sum()) for result in levels],
        }
        if levels and (name, metric) in intervals:
            entry[metric]["R40_ci95"] = [list(pair) for pair in intervals[name, metric]]
    image_results = metrics.get("2d") if evaluation.oriented else None
    entry["aos"] = image_results and {"R40": [r.aos40 for r in image_results], "R11": [r.aos11 for r in image_results]}
    if name in evaluation.notes:
        entry["rules"] = evaluation.notes[name]
    if parts is not None:
        entry["slices"] = {kind: [part.as_json() for part in slices] for kind, slices in parts.items()}
    return entry
