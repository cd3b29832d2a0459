"""Labelled objects with their points, cut out to be put into other frames (Yan et al., SECOND, Sensors 2018)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.drives.kitti import Boxes, points_in_boxes
from training.data.frame import Sample
from training.evaluation.rotated_overlap import paired_intersections

_MARGIN_M = 0.1  # points of the frame this close to an object that is put in are taken out
_GROUND_RADIUS_M = 3.0  # the ground under an object is that of the lowest points so near
_GROUND_PERCENT = 10.0
_FEWEST_GROUND_POINTS = 20
_FARTHEST_LIFT_M = 1.0


@dataclass(frozen=True, eq=False)
class BankedObject:
    """An object: its box (7,), its points (n, 4) where they were measured, and the index of its class."""

    box: np.ndarray
    points: np.ndarray
    kind: int


class ObjectBank:
    """Objects of the training frames.

    Args:
        samples: the frames.
        wanted: how many objects of each class index a frame is filled up to.
        min_points: objects with fewer points are left out.
    """

    def __init__(self, samples: Sequence[Sample], wanted: Mapping[int, int], min_points: int = 5) -> None:
        self._wanted = dict(wanted)
        self._objects: dict[int, list[BankedObject]] = {kind: [] for kind in wanted}
        for sample in samples:
            rows = np.flatnonzero(np.isin(sample.kinds, list(wanted)))
            inside = points_in_boxes(sample.points, as_boxes(sample.boxes[rows]))
            for row, mask in zip(rows, inside, strict=True):
                if mask.sum() >= min_points:
                    kind = int(sample.kinds[row])
                    self._objects[kind].append(BankedObject(sample.boxes[row], sample.points[mask], kind))

    def __len__(self) -> int:
        return sum(len(some) for some in self._objects.values())

    def fill(self, sample: Sample, rng: np.random.Generator) -> Sample:
        """The sample with objects put in until it has the wanted number of each class.

        They keep their places seen from above, stand on the ground of this frame, and overlap nothing.
        """
        boxes, chosen = sample.boxes, list[BankedObject]()
        for kind, wanted in self._wanted.items():
            missing = wanted - int((sample.kinds == kind).sum())
            stock = self._objects[kind]
            if missing <= 0 or not stock:
                continue
            for number in rng.choice(len(stock), min(missing, len(stock)), replace=False):
                candidate = _on_ground(stock[number], sample.points)
                if candidate is not None and not _overlaps(candidate.box, boxes):
                    chosen.append(candidate)
                    boxes = np.concatenate([boxes, candidate.box[None]])
        if not chosen:
            return sample
        added = np.stack([item.box for item in chosen])
        covered = points_in_boxes(sample.points, as_boxes(added), _MARGIN_M).any(0)
        points = np.concatenate([sample.points[~covered], *(item.points for item in chosen)])
        kinds = np.concatenate([sample.kinds, [item.kind for item in chosen]])
        return Sample(sample.name, points, boxes, kinds)


def as_boxes(table: np.ndarray) -> Boxes:
    """Boxes of a table (n, 7)."""
    return Boxes(table[:, :3], table[:, 3:6], table[:, 6])


def _on_ground(item: BankedObject, points: np.ndarray) -> BankedObject | None:
    """The object lifted or lowered onto the ground of a frame; None where that lies implausibly high or low."""
    offset = points[:, :2] - item.box[:2]
    near = points[(offset * offset).sum(1) < _GROUND_RADIUS_M**2, 2]
    if len(near) < _FEWEST_GROUND_POINTS:
        return item
    lift = np.float32(np.percentile(near, _GROUND_PERCENT) - (item.box[2] - item.box[5] / 2))
    if abs(lift) > _FARTHEST_LIFT_M:
        return None
    box, cut = item.box.copy(), item.points.copy()
    box[2] += lift
    cut[:, 2] += lift
    return BankedObject(box, cut, item.kind)


def _overlaps(box: np.ndarray, others: np.ndarray) -> bool:
    columns = [0, 1, 3, 4, 6]
    return bool((paired_intersections(np.repeat(box[None, columns], len(others), 0), others[:, columns]) > 0).any())
