"""Which detections overlap which objects enough, of all frames at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from training.evaluation.read import Scored, Table
from training.evaluation.rotated_overlap import paired_intersections
from training.evaluation.rules import Metric


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of an object and a detection of one frame.

    Attributes:
        label: (p,) int64 row of the labels, ascending.
        detection: (p,) int64 row of the detections, ascending within each label.
        overlap: (p,) float64, greater than what was demanded.
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
        metric: whose overlap.
        above: exclusive.
    """
    one, other = _within_frames(scored, labels, detections)
    overlap = _OVERLAPS[metric](scored.labels, one, scored.detections, other)
    enough = overlap > above
    return Pairs(one[enough], other[enough], overlap[enough])


def absorbed(scored: Scored, detections: np.ndarray, above: float) -> np.ndarray:
    """Which detections lie in a DontCare region by more than a share of their own image box, (n,) bool."""
    regions = np.flatnonzero(scored.labels.kind == "dontcare")
    region, row = _within_frames(scored, regions, detections)
    inner = scored.detections.objects.bbox
    shared, area = _shared_area(scored.labels.objects.bbox[region], inner[row]), _area(inner)[row]
    swallowed = np.zeros(len(inner), bool)
    swallowed[row[np.divide(shared, area, out=np.zeros_like(shared), where=shared > 0) > above]] = True
    return swallowed[detections]


def _within_frames(scored: Scored, labels: np.ndarray, detections: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of rows that share a frame."""
    frames = scored.detections.frame[detections]
    begin = np.searchsorted(frames, scored.labels.frame[labels], "left")
    counts = np.searchsorted(frames, scored.labels.frame[labels], "right") - begin
    first = np.repeat(np.cumsum(counts) - counts, counts)
    place = np.arange(counts.sum()) - first + np.repeat(begin, counts)
    return np.repeat(labels, counts), detections[place]


def _overlap_2d(labels: Table, one: np.ndarray, detections: Table, other: np.ndarray) -> np.ndarray:
    a, b = labels.objects.bbox, detections.objects.bbox
    shared = _shared_area(a[one], b[other])
    return _ratio(shared, _area(a)[one] + _area(b)[other] - shared)


def _overlap_bev(labels: Table, one: np.ndarray, detections: Table, other: np.ndarray) -> np.ndarray:
    a, b = _rectangles(labels), _rectangles(detections)
    shared = paired_intersections(a[one], b[other])
    return _ratio(shared, (a[:, 2] * a[:, 3])[one] + (b[:, 2] * b[:, 3])[other] - shared)


def _overlap_3d(labels: Table, one: np.ndarray, detections: Table, other: np.ndarray) -> np.ndarray:
    shared = paired_intersections(_rectangles(labels)[one], _rectangles(detections)[other])
    low, high = zip(_heights(labels), _heights(detections), strict=True)  # y points down
    shared *= np.clip(np.minimum(high[0][one], high[1][other]) - np.maximum(low[0][one], low[1][other]), 0, None)
    volumes = [table.objects.dimensions.prod(1) for table in (labels, detections)]
    return _ratio(shared, volumes[0][one] + volumes[1][other] - shared)


def _rectangles(table: Table) -> np.ndarray:
    """Footprints (n, 5) in the plane x, z of the camera: rotation_y is clockwise there."""
    objects = table.objects
    return np.column_stack([objects.location[:, [0, 2]], objects.dimensions[:, [2, 1]], -objects.rotation_y])


def _heights(table: Table) -> tuple[np.ndarray, np.ndarray]:
    bottom = table.objects.location[:, 1]
    return bottom - table.objects.dimensions[:, 0], bottom


def _shared_area(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    size = np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2])
    return np.clip(size, 0, None).prod(1)


def _area(boxes: np.ndarray) -> np.ndarray:
    return (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])


def _ratio(shared: np.ndarray, union: np.ndarray) -> np.ndarray:
    return np.divide(shared, union, out=np.zeros_like(shared), where=(shared > 0) & (union > 0))


_OVERLAPS = {"2d": _overlap_2d, "bev": _overlap_bev, "3d": _overlap_3d}
