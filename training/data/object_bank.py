"""Labelled objects with their points, to be inserted into other frames (Yan et al., SECOND, Sensors 2018)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from cosim.drives.kitti import Boxes, points_in_boxes
from training.data.frame import TrainingSample
from training.data.grid import Grid
from training.evaluation.rotated_overlap import paired_intersections

if TYPE_CHECKING:
    from training.data.level_ground import LocalGround

_MARGIN_M = 0.1  # points of the frame this close to an inserted object are removed
_GROUND = Grid((0.0, -40.0, -3.0), (70.4, 40.0, 1.0), (0.8, 0.8, 4.0))  # range of the ground estimate
_FARTHEST_LIFT_M = 1.0


@dataclass(frozen=True, eq=False)
class BankedObject:
    """An object: its box (7,), its measured points (n, 4), and its class index.

    Attributes:
        rise_m: ground height under it, as estimated by `level_ground`.
    """

    box: np.ndarray
    points: np.ndarray
    kind: int
    rise_m: float


class ObjectBank:
    """Objects of the training frames.

    Args:
        samples: the frames.
        wanted: number of objects per frame and class index.
        min_points: objects with fewer points are omitted.
    """

    def __init__(self, samples: Sequence[TrainingSample], wanted: Mapping[int, int], min_points: int = 5) -> None:
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
        return sum(len(subset) for subset in self._objects.values())

    def fill(self, sample: TrainingSample, rng: np.random.Generator) -> TrainingSample:
        """Insert objects until the sample has the wanted number of each class.

        Objects keep their horizontal position and their height above ground, and do not overlap others.
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
        return TrainingSample(sample.name, points, np.concatenate([sample.boxes, added]), class_ids)


def as_boxes(table: np.ndarray) -> Boxes:
    """Convert a table (n, 7) to boxes."""
    return Boxes(table[:, :3], table[:, 3:6], table[:, 6])


def _move_to_ground(items: list[BankedObject], ground: LocalGround) -> list[BankedObject]:
    """Shift objects to their height above the ground of a frame; drop those that would move too far."""
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


def _estimate_ground(sample: TrainingSample) -> LocalGround:
    import torch

    from training.data.level_ground import find_ground

    return find_ground(torch.from_numpy(np.insert(sample.points, 0, 0, axis=1)), 1, _GROUND)


def _estimate_grounds(samples: Sequence[TrainingSample]) -> dict[TrainingSample, LocalGround]:
    """Estimate the ground of each frame; all heights are stored in one array.

    Thousands of separate small arrays would need four times the memory because of fragmentation.
    """
    if not samples:
        return {}
    first = _estimate_ground(samples[0])
    heights = first.height.repeat(len(samples), 1, 1)
    for number, sample in enumerate(samples):
        heights[number] = _estimate_ground(sample).height[0]
    return {sample: replace(first, height=height[None]) for sample, height in zip(samples, heights, strict=True)}


def _ground_rises(ground: LocalGround, boxes: np.ndarray) -> np.ndarray:
    """Ground height above the level (n,) [m] under boxes (n, 7)."""
    import torch

    positions = torch.from_numpy(np.ascontiguousarray(boxes[:, :2], np.float32))
    return ground.rise(torch.zeros(len(positions), dtype=torch.int64), positions).numpy()


def _drop_overlapping(items: list[BankedObject], boxes: np.ndarray) -> list[BankedObject]:
    """Keep objects that overlap neither boxes (n, 7) nor an earlier object."""
    accepted = []
    for item in items:
        if not _overlaps(item.box, boxes):
            accepted.append(item)
            boxes = np.concatenate([boxes, item.box[None]])
    return accepted


def _overlaps(box: np.ndarray, others: np.ndarray) -> bool:
    columns = [0, 1, 3, 4, 6]
    return bool((paired_intersections(np.repeat(box[None, columns], len(others), 0), others[:, columns]) > 0).any())
