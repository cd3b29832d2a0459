"""Losses of average precision of one or two sets of detections."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.drives.kitti import Drive
from training.errors import EvaluationError
from training.evaluation.bootstrap import interval
from training.evaluation.evaluate import evaluate
from training.evaluation.losses.box_errors import BoxErrors, box_errors
from training.evaluation.losses.faults import BOX_PARTS, OTHER_KINDS, Faults, find_faults
from training.evaluation.losses.split import LossSplit, Part, draw_frames, parts_of_loss, split_loss
from training.evaluation.read import Scored
from training.evaluation.rules import DIFFICULTIES, Metric
from training.evaluation.slices import points_in_rows

#: Metrics whose losses are computed, in the order of pages and JSON.
SPLIT: tuple[Metric, ...] = ("3d", "bev")
#: Number of sets of error types that are corrected for one set of detections.
SETS_MENDED = sum(2 ** (len(BOX_PARTS[metric]) + len(OTHER_KINDS)) for metric in SPLIT)
_WORDS: dict[Metric, str] = {"3d": "3D", "bev": "bird's eye"}


@dataclass(frozen=True, eq=False)
class Losses:
    """Losses of one set of detections.

    Attributes:
        title: plain text.
        frames: number of frames.
        r40: by metric, the devkit's average precision [%].
        splits: by metric.
        parts: by metric and by what objects are sorted.
        errors: of boxes, by distance.
    """

    title: str
    frames: int
    r40: dict[Metric, float]
    splits: dict[Metric, LossSplit]
    parts: dict[Metric, dict[str, list[Part]]]
    errors: list[BoxErrors]

    def __str__(self) -> str:
        lines = []
        for metric, split in self.splits.items():
            worst = sorted(split.share, key=lambda kind: -split.share[kind])
            summary = ", ".join(f"{kind.replace('_', ' ')} {split.share[kind]:.1f}" for kind in worst)
            lines.append(
                f"{self.title}: {_WORDS[metric]} AP {split.ap:.1f} (R40 {self.r40[metric]:.1f}); lost to {summary}"
            )
        return "\n".join(lines)


def find_losses(
    scored: Scored,
    name: str,
    difficulty: str,
    title: str,
    *,
    drive: Drive | None = None,
    times: np.ndarray | None = None,
    on_set: Callable[[], None] = lambda: None,
) -> Losses:
    """Compute the losses of a set of detections by error type.

    Args:
        scored: labels and detections.
        name: the class.
        difficulty: easy, moderate or hard.
        title: plain text.
        drive: drive with the scans, to count points in boxes.
        times: (draws, f) bootstrap draws of frames; see `draw_frames`.
        on_set: called after each set of error types.

    Raises:
        EvaluationError: the class has no detections, or no labels that count.
    """
    level = DIFFICULTIES.index(difficulty)
    results = evaluate(scored, classes=(name,)).results.get(name)
    if results is None or not set(SPLIT) <= set(results):
        raise EvaluationError(f"{title}: no box of {name} is detected; there is nothing to split")
    if not results["3d"][level].task.object_counts.any():
        raise EvaluationError(f"{title}: no {name} counts as {difficulty}; choose other frames or --difficulty hard")
    faults = {metric: find_faults(scored, name, metric, level) for metric in SPLIT}
    points = _points(faults["3d"], drive)
    return Losses(
        title,
        len(scored.names),
        {metric: results[metric][level].r40 for metric in SPLIT},
        {metric: split_loss(faults[metric], times, on_set) for metric in SPLIT},
        {metric: parts_of_loss(faults[metric], *points) for metric in SPLIT},
        box_errors(faults["3d"]),
    )


def drawn_frames(first: Scored, second: Scored | None, draws: int, seed: int) -> list[np.ndarray | None]:
    """Bootstrap draws of one or two sets; identical for identical frames, so that differences are paired."""
    if not draws:
        return [None, None]
    draws_of_first = draw_frames(len(first.names), draws, np.random.default_rng([seed, 0]))
    if second is None or second.names == first.names:
        return [draws_of_first, draws_of_first]
    return [draws_of_first, draw_frames(len(second.names), draws, np.random.default_rng([seed, 1]))]


def as_json(name: str, difficulty: str, sets: list[Losses]) -> dict[str, Any]:
    """The result as JSON; averages and shares in percent."""
    return {
        "class": name,
        "difficulty": difficulty,
        "sets": [_set_json(losses) for losses in sets],
        "difference": _difference_json(*sets) if len(sets) == 2 else None,
    }


def difference(first: LossSplit, second: LossSplit) -> dict[str, tuple[float, tuple[float, float] | None]]:
    """Difference first − second of `ap` and of each share, with its 95 % interval if frames were drawn."""
    values = {"ap": first.ap - second.ap}
    values |= {kind: first.share[kind] - second.share[kind] for kind in first.share}
    if not len(first.drawn):
        return {key: (value, None) for key, value in values.items()}
    drawn = first.drawn - second.drawn
    return {key: (value, interval(drawn[:, column])) for column, (key, value) in enumerate(values.items())}


def intervals(split: LossSplit) -> dict[str, tuple[float, float] | None]:
    """95 % intervals of `ap` and of the share of each kind; None without draws."""
    names = ("ap", *split.share)
    return {key: interval(split.drawn[:, column]) if len(split.drawn) else None for column, key in enumerate(names)}


def _points(faults: Faults, drive: Drive | None) -> tuple[np.ndarray | None, np.ndarray | None]:
    if drive is None:
        return None, None
    scored, task = faults.task.scored, faults.task
    objects = task.object_counts | (faults.box >= 0)
    return (
        points_in_rows(scored.labels, objects, scored.names, drive),
        points_in_rows(scored.detections, task.valid, scored.names, drive),
    )


def _set_json(losses: Losses) -> dict[str, Any]:
    entry: dict[str, Any] = {"title": losses.title, "frames": losses.frames}
    for metric, split in losses.splits.items():
        bounds, faults = intervals(split), split.faults
        entry[metric] = {
            "R40": losses.r40[metric],
            "ap": split.ap,
            "ap_ci95": bounds["ap"],
            "objects": int(faults.task.object_counts.sum()),
            "missed": int(faults.missed.sum()),
            "misfits": int((faults.misfits & faults.task.object_counts).sum()),
            "kinds": {
                kind: {"share": split.share[kind], "share_ci95": bounds[kind], "alone": split.alone[kind]}
                for kind in split.share
            },
            "parts": {
                by: [{"name": part.name, "objects": part.objects, "gain": part.gain} for part in item]
                for by, item in losses.parts[metric].items()
            },
        }
    entry["box_errors"] = [
        {"name": item.name, "objects": item.objects, "median": item.median, "spread": item.spread}
        for item in losses.errors
    ]
    return entry


def _difference_json(first: Losses, second: Losses) -> dict[str, Any]:
    return {
        metric: {
            key: {"difference": value, "ci95": bounds}
            for key, (value, bounds) in difference(first.splits[metric], second.splits[metric]).items()
        }
        for metric in SPLIT
    }
