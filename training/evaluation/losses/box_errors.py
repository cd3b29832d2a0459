"""Errors of detected boxes by distance: median and spread of every part of a box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cosim.drives.kitti import Labels
from training.evaluation.losses.faults import Faults
from training.evaluation.slices import DISTANCE_EDGES_M, distance_words


@dataclass(frozen=True)
class BoxErrors:
    """Errors of the boxes of a set of objects: detected minus labelled.

    Attributes:
        name: name of the set.
        objects: number of objects with a box.
        median, spread: by part of a box, see `PARTS`; the spread is half the distance from the 16th to the 84th
            percentile, a standard deviation where errors are normal.
    """

    name: str
    objects: int
    median: dict[str, float]
    spread: dict[str, float]


def box_errors(faults: Faults) -> list[BoxErrors]:
    """Errors of the boxes of all objects that count, and by distance."""
    scored = faults.task.scored
    rows = np.flatnonzero(faults.task.object_counts & (faults.box >= 0))
    truth, detected = scored.labels.objects[rows], scored.detections.objects[faults.box[rows]]
    errors = {name: error(detected, truth) for name, error in PARTS.items()}
    distance = np.hypot(truth.location[:, 0], truth.location[:, 2])
    summaries = [_summary("all", errors, np.ones(len(rows), bool))]
    for name, (low, high) in zip(distance_words(), pairwise(DISTANCE_EDGES_M), strict=True):
        summaries.append(_summary(name, errors, (distance >= low) & (distance < high)))
    return [summary for summary in summaries if summary.objects]


def _summary(name: str, errors: dict[str, np.ndarray], mask: np.ndarray) -> BoxErrors:
    if not mask.any():
        return BoxErrors(name, 0, {}, {})
    low, middle, high = (
        {part: float(np.quantile(e[mask], q)) for part, e in errors.items()} for q in (0.16, 0.5, 0.84)
    )
    return BoxErrors(name, int(mask.sum()), middle, {part: (high[part] - low[part]) / 2 for part in errors})


def _radial_error(detected: Labels, truth: Labels) -> np.ndarray:
    """Along the line of sight, positive beyond the object [m]."""
    sight = truth.location[:, [0, 2]] / np.maximum(np.linalg.norm(truth.location[:, [0, 2]], axis=1), 1e-9)[:, None]
    return ((detected.location - truth.location)[:, [0, 2]] * sight).sum(1)


def _lateral_error(detected: Labels, truth: Labels) -> np.ndarray:
    """Across the line of sight, positive to the left [m]."""
    sight = truth.location[:, [0, 2]] / np.maximum(np.linalg.norm(truth.location[:, [0, 2]], axis=1), 1e-9)[:, None]
    x, z = (detected.location - truth.location)[:, [0, 2]].T
    return z * sight[:, 0] - x * sight[:, 1]


def _centre_height(labels: Labels) -> np.ndarray:
    return labels.dimensions[:, 0] / 2 - labels.location[:, 1]


def _heading_error(detected: Labels, truth: Labels) -> np.ndarray:
    """Counter-clockwise from above [deg]; modulo 180°, because overlaps do not distinguish front and rear."""
    turned = np.degrees(truth.rotation_y - detected.rotation_y)
    return (turned + 90) % 180 - 90


#: Parts of a box with how their error is measured; names end in their unit.
PARTS: dict[str, Callable[[Labels, Labels], np.ndarray]] = {
    "away_m": _radial_error,
    "aside_m": _lateral_error,
    "height_m": lambda detected, truth: _centre_height(detected) - _centre_height(truth),
    "length_m": lambda detected, truth: detected.dimensions[:, 2] - truth.dimensions[:, 2],
    "width_m": lambda detected, truth: detected.dimensions[:, 1] - truth.dimensions[:, 1],
    "tallness_m": lambda detected, truth: detected.dimensions[:, 0] - truth.dimensions[:, 0],
    "heading_deg": _heading_error,
}
