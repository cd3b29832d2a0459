"""Find pairs of detections and objects with sufficient overlap, for all frames at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.drives.kitti import Labels
from training.evaluation.read import Scored
from training.evaluation.rotated_overlap import paired_intersections
from training.evaluation.rules import Metric


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of an object and a detection of one frame.

    Attributes:
        label: (p,) int64 row of the labels, ascending.
        detection: (p,) int64 row of the detections, ascending within each label.
        overlap: (p,) float64, greater than the required overlap.
    """

    label: np.ndarray
    detection: np.ndarray
    overlap: np.ndarray


def overlapping(scored: Scored, labels: np.ndarray, detections: np.ndarray, metric: Metric, above: float) -> Pairs:
    """Pairs among some rows whose intersection over union is greater than `above`.

    Args:
        scored: the frames.
        labels: rows of the labels, ascending.
        detections: rows of the detections, ascending.
        metric: metric that defines the overlap.
        above: exclusive.
    """
    label_rows, detection_rows = _within_frames(scored, labels, detections)
    overlap = paired_overlaps(scored.labels.objects[label_rows], scored.detections.objects[detection_rows], metric)
    enough = overlap > above
    return Pairs(label_rows[enough], detection_rows[enough], overlap[enough])


def paired_overlaps(first: Labels, second: Labels, metric: Metric) -> np.ndarray:
    """Intersection over union of the i-th of the first and the i-th of the second, (n,) float64 in 0–1."""
    return _OVERLAPS[metric](first, second)


def absorbed(scored: Scored, detections: np.ndarray, above: float) -> np.ndarray:
    """(n,) bool detections of whose image box more than a given share lies in a DontCare region."""
    regions = np.flatnonzero(scored.labels.kind == "dontcare")
    region, row = _within_frames(scored, regions, detections)
    inner = scored.detections.objects.bbox
    shared, area = _shared_area(scored.labels.objects.bbox[region], inner[row]), _area(inner)[row]
    is_absorbed = np.zeros(len(inner), bool)
    is_absorbed[row[np.divide(shared, area, out=np.zeros_like(shared), where=shared > 0) > above]] = True
    return is_absorbed[detections]


def _within_frames(scored: Scored, labels: np.ndarray, detections: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of rows that share a frame."""
    frames = scored.detections.frame[detections]
    start = np.searchsorted(frames, scored.labels.frame[labels], "left")
    counts = np.searchsorted(frames, scored.labels.frame[labels], "right") - start
    first = np.repeat(np.cumsum(counts) - counts, counts)
    index = np.arange(counts.sum()) - first + np.repeat(start, counts)
    return np.repeat(labels, counts), detections[index]


def _overlap_2d(first: Labels, second: Labels) -> np.ndarray:
    shared = _shared_area(first.bbox, second.bbox)
    return _ratio(shared, _area(first.bbox) + _area(second.bbox) - shared)


def _overlap_bev(first: Labels, second: Labels) -> np.ndarray:
    a, b = _rectangles(first), _rectangles(second)
    shared = paired_intersections(a, b)
    return _ratio(shared, a[:, 2] * a[:, 3] + b[:, 2] * b[:, 3] - shared)


def _overlap_3d(first: Labels, second: Labels) -> np.ndarray:
    shared = paired_intersections(_rectangles(first), _rectangles(second))
    low, high = zip(_heights(first), _heights(second), strict=True)  # y points down
    shared *= np.clip(np.minimum(*high) - np.maximum(*low), 0, None)
    return _ratio(shared, first.dimensions.prod(1) + second.dimensions.prod(1) - shared)


def _rectangles(objects: Labels) -> np.ndarray:
    """Footprints (n, 5) in the plane x, z of the camera: rotation_y is clockwise there."""
    return np.column_stack([objects.location[:, [0, 2]], objects.dimensions[:, [2, 1]], -objects.rotation_y])


def _heights(objects: Labels) -> tuple[np.ndarray, np.ndarray]:
    bottom = objects.location[:, 1]
    return bottom - objects.dimensions[:, 0], bottom


def _shared_area(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    size = np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2])
    return np.clip(size, 0, None).prod(1)


def _area(boxes: np.ndarray) -> np.ndarray:
    return (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])


def _ratio(shared: np.ndarray, union: np.ndarray) -> np.ndarray:
    return np.divide(shared, union, out=np.zeros_like(shared), where=(shared > 0) & (union > 0))


_OVERLAPS = {"2d": _overlap_2d, "bev": _overlap_bev, "3d": _overlap_3d}
