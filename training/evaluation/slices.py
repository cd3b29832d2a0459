"""Average precision of subsets of the objects: by distance, by points in the box, by occlusion.

False positives have neither points of an object nor an occlusion, so all of them count in every subset, and the
precision is normalised to the size of the whole set: R·N / (R·N + F), with recall R in the
subset, N objects in the whole set and F false positives (normalised precision: Hoiem, Chodpathumwan & Dai, "Diagnosing
Error in Object Detectors", ECCV 2012, section 2.1). The subsets can then be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Drive, points_in_boxes
from training.evaluation.average_precision import continuous_average
from training.evaluation.evaluate import Result
from training.evaluation.matching import assign_detections, count
from training.evaluation.read import ScoreTable

DISTANCE_EDGES_M = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 80.0)
POINT_EDGES = (0, 5, 20, 50, 100, 300, 1000, 10_000_000)
OCCLUSIONS = ("visible", "partly", "largely")
_STEPS = 200


@dataclass(frozen=True)
class ScoreSlice:
    """A subset of the objects: name, number of objects, average precision [%] and highest recall [%]."""

    name: str
    objects: int
    ap: float
    recall: float

    def as_json(self) -> dict[str, object]:
        """For `--json`."""
        return {"name": self.name, "objects": self.objects, "ap": self.ap, "recall": self.recall}


def slices(result: Result, points: np.ndarray | None = None) -> dict[str, list[ScoreSlice]]:
    """`distance`, `occlusion` and, where points were counted, `points`: the subsets that contain objects.

    Args:
        result: a class by a metric at a difficulty; `hard` has most objects.
        points: (g,) points in the box of every label row; see `points_in_labels`.
    """
    objects = result.task.scored.labels.objects
    distance = np.hypot(objects.location[:, 0], objects.location[:, 2])
    parts = {
        "distance": _parts(result, np.searchsorted(DISTANCE_EDGES_M, distance, "right") - 1, distance_words()),
        "occlusion": _parts(result, objects.occluded, OCCLUSIONS),
    }
    if points is not None:
        parts["points"] = _parts(result, np.searchsorted(POINT_EDGES, points, "right") - 1, point_words())
    return parts


def distance_words() -> list[str]:
    """Names of the parts by distance."""
    return [f"{low:g}–{high:g} m" for low, high in pairwise(DISTANCE_EDGES_M)]


def point_words() -> list[str]:
    """Names of the parts by points in the box."""
    return [*(f"{low:,}–{high - 1:,}" for low, high in pairwise(POINT_EDGES[:-1])), f"{POINT_EDGES[-2]:,}+"]


def points_in_labels(result: Result, drive: Drive) -> np.ndarray:
    """Count the points of the drive's scans in each label's box, (g,) int64; 0 for frames without scan."""
    return points_in_rows(result.task.scored.labels, result.task.object_counts, result.task.scored.names, drive)


def points_in_rows(table: ScoreTable, wanted: np.ndarray, names: Sequence[str], drive: Drive) -> np.ndarray:
    """Count the points of the drive's scans in the selected boxes.

    Args:
        table: labels or detections.
        wanted: (n,) bool, rows to count; all others, and rows of frames that the drive does not have, are 0.
        names: of the frames.
        drive: drive with the scans.

    Returns:
        (n,) int64.
    """
    counts = np.zeros(len(table.kind), np.int64)
    for number, name in enumerate(names):
        rows = np.flatnonzero(wanted & (table.frame == number))
        if len(rows) and name in drive:
            frame = drive[name]
            boxes = table.objects[rows].boxes_velo(frame.calibration)
            counts[rows] = points_in_boxes(frame.points, boxes).sum(1)
    return counts


def neighbouring_scans(labels: Path) -> Drive | None:
    """Return the drive that contains a folder of labels, or None if it has no scans."""
    folder = labels.resolve().parent
    has_scans = (
        (folder / "velodyne").is_dir() and (folder / "calib").is_dir() and any((folder / "velodyne").glob("*.bin"))
    )
    return Drive(folder) if has_scans else None


def _parts(result: Result, part: np.ndarray, names: Sequence[str]) -> list[ScoreSlice]:
    task = result.task
    thresholds = result.thresholds[:: max(1, len(result.thresholds) // _STEPS)]
    assigned, false_positives = assign_detections(task, thresholds), count(task, thresholds).fp[:, 0]
    hit = (assigned >= 0) & task.valid[assigned]
    everything = task.object_counts.sum()
    result_slices = []
    for number, name in enumerate(names):
        in_part = task.object_counts & (part == number)
        if not in_part.any():
            continue
        recall = hit[:, in_part].sum(1) / in_part.sum()
        expected_hits = recall * everything
        precision = np.divide(
            expected_hits,
            expected_hits + false_positives,
            out=np.zeros_like(expected_hits),
            where=expected_hits + false_positives > 0,
        )
        best = 100 * float(recall.max(initial=0.0))
        result_slices.append(ScoreSlice(name, int(in_part.sum()), continuous_average(recall, precision), best))
    return result_slices
