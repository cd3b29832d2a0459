"""Split the loss of average precision among error types.

With all error types of `training.evaluation.losses.faults` corrected, the continuous average precision is 100. The loss
is split among them by the Shapley value (Shapley, "A Value for n-Person Games", 1953), the mean gain of correcting a
type over all orders in which types can be corrected. Shares add up to the loss, so that those of two detectors, or of
two test sets, can be subtracted. `alone` is TIDE's figure: the gain if only this type is corrected.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import factorial

import numpy as np

from training.evaluation.average_precision import continuous_average, whole_curve
from training.evaluation.evaluate import curve_thresholds
from training.evaluation.losses.faults import Faults, subsets
from training.evaluation.matching import Task, count, hit_scores
from training.evaluation.slices import DISTANCE_EDGES_M, OCCLUSIONS, POINT_EDGES, distance_words, point_words

_THRESHOLDS = 100  # maximum number of scores per curve: hundreds of curves are computed


@dataclass(frozen=True, eq=False)
class LossSplit:
    """The loss of average precision [%] of a class by a metric at a difficulty.

    Attributes:
        faults: errors of the detections.
        ap: average precision.
        share: loss by error type; the sum is 100 − ap.
        alone: gain by error type if only this type is corrected.
        drawn: (draws, 1 + error types) float64: ap and shares of sets drawn from the frames; no rows without draws.
    """

    faults: Faults
    ap: float
    share: dict[str, float]
    alone: dict[str, float]
    drawn: np.ndarray


@dataclass(frozen=True)
class Part:
    """Errors of a subset: its name, number of objects, and the gain [%] of correcting each type in it."""

    name: str
    objects: int
    gain: dict[str, float]


def split_loss(faults: Faults, times: np.ndarray | None = None, on_set: Callable[[], None] = lambda: None) -> LossSplit:
    """Split the loss among all error types.

    Args:
        faults: errors of the detections.
        times: (draws, f) number of times each bootstrap draw contains each frame.
        on_set: called after each set of error types; there are 2 to the number of types.
    """
    error_types = faults.error_types
    reached = {}
    for subset in subsets(error_types):
        reached[subset] = _average_precisions(faults.corrected(subset), times)
        on_set()
    shares = np.stack([_shapley(reached, kind, error_types) for kind in error_types], -1)
    ap = reached[frozenset()]
    return LossSplit(
        faults,
        float(ap[0]),
        {kind: float(value) for kind, value in zip(error_types, shares[0], strict=True)},
        {kind: float(reached[frozenset({kind})][0] - ap[0]) for kind in error_types},
        np.column_stack([ap, shares])[1:],
    )


def draw_frames(frames: int, draws: int, rng: np.random.Generator) -> np.ndarray:
    """Draw frames with replacement: number of times each draw contains each frame, (draws, frames) int64."""
    return np.stack([np.bincount(rng.integers(0, frames, frames), minlength=frames) for _ in range(draws)])


def parts_of_loss(
    faults: Faults, points: np.ndarray | None, detection_points: np.ndarray | None
) -> dict[str, list[Part]]:
    """Gain of correcting each error type by distance, occlusion and, if counted, points in the box.

    Only errors of one subset are corrected. False alarms are assigned by their own distance and points; they have no
    occlusion.

    Args:
        faults: errors of the detections.
        points: (g,) points in the box of every label row.
        points_found: (d,) the same of the detections.
    """
    scored = faults.task.scored
    labels, detections = scored.labels.objects, scored.detections.objects
    partitions = {
        "distance": (
            _bins(_distance(labels.location), DISTANCE_EDGES_M),
            _bins(_distance(detections.location), DISTANCE_EDGES_M),
            distance_words(),
        ),
        "occlusion": (labels.occluded, None, OCCLUSIONS),
    }
    if points is not None and detection_points is not None:
        partitions["points"] = (_bins(points, POINT_EDGES), _bins(detection_points, POINT_EDGES), point_words())
    before = float(_average_precisions(faults.task, None)[0])
    return {name: _parts(faults, before, *subset) for name, subset in partitions.items()}


def _parts(
    faults: Faults, before: float, of_object: np.ndarray, of_detection: np.ndarray | None, names: Sequence[str]
) -> list[Part]:
    parts = []
    for number, name in enumerate(names):
        in_part = of_object == number
        among = None if of_detection is None else of_detection == number
        object_count = int((faults.task.object_counts & in_part).sum())
        false_positives = (
            {}
            if among is None
            else {"false_alarms": faults.false_alarms & among, "other_class": faults.other_class & among}
        )
        if not object_count and not any(rows.any() for rows in false_positives.values()):
            continue
        error_types = [
            kind for kind in faults.error_types if among is not None or kind not in ("false_alarms", "other_class")
        ]
        gain = {
            kind: float(_average_precisions(faults.corrected([kind], in_part, among), None)[0]) - before
            for kind in error_types
        }
        parts.append(Part(name, object_count, gain))
    return parts


def _average_precisions(task: Task, times: np.ndarray | None) -> np.ndarray:
    """Continuous average precision [%] of all frames, and of each draw, (1 + draws,) float64."""
    thresholds = curve_thresholds(hit_scores(task)[0], _THRESHOLDS)
    counts = count(task, thresholds, by_frame=times is not None)
    if times is None:
        return np.array([continuous_average(*whole_curve(counts))])
    weights = np.concatenate([np.ones((1, times.shape[1]), times.dtype), times])
    return np.array([continuous_average(*whole_curve(counts.of_frames(row))) for row in weights])


def _shapley(reached: dict[frozenset[str], np.ndarray], kind: str, error_types: Sequence[str]) -> np.ndarray:
    """Mean gain of an error type over all orders, (1 + draws,) float64."""
    many, share = len(error_types), np.zeros_like(reached[frozenset()])
    for subset in subsets([other for other in error_types if other != kind]):
        weight = factorial(len(subset)) * factorial(many - len(subset) - 1) / factorial(many)
        share += weight * (reached[subset | {kind}] - reached[subset])
    return share


def _distance(location: np.ndarray) -> np.ndarray:
    return np.hypot(location[:, 0], location[:, 2])


def _bins(values: np.ndarray, edges: Sequence[float]) -> np.ndarray:
    return np.searchsorted(edges, values, "right") - 1
