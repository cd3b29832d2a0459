"""Labelled objects with their points, cut out to be put into other frames (Yan et al., SECOND, Sensors 2018)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from cosim.drives.kitti import Boxes, points_in_boxes
from training.data.frame import Sample
from training.data.grid import Grid
from training.evaluation.rotated_overlap import paired_intersections

if TYPE_CHECKING:
    from training.data.level_ground import Ground

_MARGIN_M = 0.1  # points of the frame this close to an object that is put in are taken out
_GROUND = Grid((0.0, -40.0, -3.0), (70.4, 40.0, 1.0), (0.8, 0.8, 4.0))  # where the ground is looked for
_FARTHEST_LIFT_M = 1.0


@dataclass(frozen=True, eq=False)
class BankedObject:
    """An object: its box (7,), its points (n, 4) where they were measured, and the index of its class.

    Attributes:
        rise_m: of the ground under it, as `level_ground` finds it.
    """

    box: np.ndarray
    points: np.ndarray
    kind: int
    rise_m: float


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
        self._grounds = _estimate_grounds(samples)
        for sample in samples:
            rows = np.flatnonzero(np.isin(sample.class_ids, list(wanted)))
            inside = points_in_boxes(sample.points, as_boxes(sample.boxes[rows]))
            rises = _ground_rises(self._grounds[sample], sample.boxes[rows])
            for row, mask, rise_m in zip(rows, inside, rises, strict=True):
                if mask.sum() >= min_points:
                    kind = int(sample.class_ids[row])
                    self._objects[kind].append(BankedObject(sample.boxes[row], sample.points[mask], kind, rise_m))

    def __len__(self) -> int:
        return sum(len(some) for some in self._objects.values())

    def fill(self, sample: Sample, rng: np.random.Generator) -> Sample:
        """The sample with objects put in until it has the wanted number of each class.

        They keep their places seen from above and their heights above the ground about them, and overlap nothing.
        """
        chosen = list[BankedObject]()
        for kind, wanted in self._wanted.items():
            missing = wanted - int((sample.class_ids == kind).sum())
            stock = self._objects[kind]
            if missing > 0 and stock:
                chosen += [stock[number] for number in rng.choice(len(stock), min(missing, len(stock)), replace=False)]
        ground = self._grounds.get(sample) or _estimate_ground(sample)
        chosen = _drop_overlapping(_move_to_ground(chosen, ground), sample.boxes)
        if not chosen:
            return sample
        added = np.stack([item.box for item in chosen])
        covered = points_in_boxes(sample.points, as_boxes(added), _MARGIN_M).any(0)
        points = np.concatenate([sample.points[~covered], *(item.points for item in chosen)])
        class_ids = np.concatenate([sample.class_ids, [item.kind for item in chosen]])
        return Sample(sample.name, points, np.concatenate([sample.boxes, added]), class_ids)


def as_boxes(table: np.ndarray) -> Boxes:
    """Boxes of a table (n, 7)."""
    return Boxes(table[:, :3], table[:, 3:6], table[:, 6])


def _move_to_ground(items: list[BankedObject], ground: Ground) -> list[BankedObject]:
    """Objects as high above the ground of a frame as above their own; without those that would rise or sink too far."""
    if not items:
        return []
    moved = []
    for item, rise_m in zip(items, _ground_rises(ground, np.stack([item.box for item in items])), strict=True):
        lift = np.float32(rise_m - item.rise_m)
        if abs(lift) <= _FARTHEST_LIFT_M:
            box, cut = item.box.copy(), item.points.copy()
            box[2] += lift
            cut[:, 2] += lift
            moved.append(BankedObject(box, cut, item.kind, rise_m))
    return moved


def _estimate_ground(sample: Sample) -> Ground:
    import torch

    from training.data.level_ground import find_ground

    return find_ground(torch.from_numpy(np.insert(sample.points, 0, 0, axis=1)), 1, _GROUND)


def _estimate_grounds(samples: Sequence[Sample]) -> dict[Sample, Ground]:
    """The ground of each frame; heights of all lie in one array.

    Thousands of small arrays, each between large ones that come and go, would hold four times their memory.
    """
    if not samples:
        return {}
    first = _estimate_ground(samples[0])
    heights = first.height.repeat(len(samples), 1, 1)
    for number, sample in enumerate(samples):
        heights[number] = _estimate_ground(sample).height[0]
    return {sample: replace(first, height=height[None]) for sample, height in zip(samples, heights, strict=True)}


def _ground_rises(ground: Ground, boxes: np.ndarray) -> np.ndarray:
    """How far the ground of a frame lies above the level (n,) [m] under boxes (n, 7)."""
    import torch

    positions = torch.from_numpy(np.ascontiguousarray(boxes[:, :2], np.float32))
    return ground.rise(torch.zeros(len(positions), dtype=torch.int64), positions).numpy()


def _drop_overlapping(items: list[BankedObject], boxes: np.ndarray) -> list[BankedObject]:
    """Those objects that overlap neither boxes (n, 7) nor an earlier one."""
    accepted = []
    for item in items:
        if not _overlaps(item.box, boxes):
            accepted.append(item)
            boxes = np.concatenate([boxes, item.box[None]])
    return accepted


def _overlaps(box: np.ndarray, others: np.ndarray) -> bool:
    columns = [0, 1, 3, 4, 6]
    return bool((paired_intersections(np.repeat(box[None, columns], len(others), 0), others[:, columns]) > 0).any())
