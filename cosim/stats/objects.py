"""All labelled objects of a set in one table, and KITTI's difficulty levels."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np

from cosim.drives.kitti import Calibration, Labels, wrap_angle

DIFFICULTIES = ("easy", "moderate", "hard")
# KITTI object development kit, evaluate_object.cpp: least box height [px], most occlusion, most truncation
_LIMITS = ((40.0, 0, 0.15), (25.0, 1, 0.30), (25.0, 2, 0.50))
NOT_COUNTED = -1


@dataclass(frozen=True, eq=False)
class LabelledObjects:
    """A row an object, without `DontCare` regions.

    Attributes:
        frame: (n,) int64 row of the frame in the set.
        type: (n,) str class names.
        size: (n, 3) float64 length, width, height [m].
        centre: (n, 3) float64 centre of the box in LiDAR axes [m].
        yaw: (n,) float64 heading in LiDAR axes, 0 ahead, counter-clockwise, in [−π, π) [rad].
        truncated: (n,) float64.
        occluded: (n,) int64.
        bbox: (n, 4) float64 2D box: left, top, right, bottom [px].
        points: (n,) int64 points in the box; −1 without a scan.
    """

    frame: np.ndarray
    type: np.ndarray
    size: np.ndarray
    centre: np.ndarray
    yaw: np.ndarray
    truncated: np.ndarray
    occluded: np.ndarray
    bbox: np.ndarray
    points: np.ndarray

    @classmethod
    def of(cls, labels: Labels, calibration: Calibration, frame: int, points: np.ndarray | None) -> LabelledObjects:
        """The objects of one frame; `labels` without `DontCare`, `points` (n,) counts or None."""
        boxes = labels.boxes_velo(calibration)
        return cls(
            frame=np.full(len(labels), frame, np.int64),
            type=np.array(labels.type, np.str_),
            size=boxes.size,
            centre=boxes.centre,
            yaw=wrap_angle(boxes.yaw),
            truncated=labels.truncated,
            occluded=labels.occluded,
            bbox=labels.bbox,
            points=np.full(len(labels), NOT_COUNTED, np.int64) if points is None else points,
        )

    @classmethod
    def merge(cls, tables: Iterable[LabelledObjects]) -> LabelledObjects:
        """All rows, in order."""
        empty = cls(
            *(np.zeros(0, np.int64), np.zeros(0, np.str_), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)),
            *(np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 4)), np.zeros(0, np.int64)),
        )
        rows = [empty, *tables]
        return cls(
            **{field.name: np.concatenate([getattr(table, field.name) for table in rows]) for field in fields(cls)}
        )

    def __len__(self) -> int:
        return len(self.frame)

    def __getitem__(self, rows: np.ndarray) -> LabelledObjects:
        """Some of the objects, by mask or index array."""
        return LabelledObjects(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    def of_type(self, name: str) -> LabelledObjects:
        """The objects of one class, case-insensitive as in KITTI's evaluation."""
        return self[np.char.lower(self.type) == name.lower()]

    @property
    def distance_m(self) -> np.ndarray:
        """(n,) float64 ground distance of the centre from the LiDAR [m]."""
        return np.hypot(self.centre[:, 0], self.centre[:, 1])

    @property
    def image_height_px(self) -> np.ndarray:
        """(n,) float64 height of the 2D box [px]."""
        return self.bbox[:, 3] - self.bbox[:, 1]

    @property
    def visible(self) -> np.ndarray:
        """(n,) bool: not occluded and truncated by at most 0.15."""
        return (self.occluded == 0) & (self.truncated <= _LIMITS[0][2])


def difficulty(objects: LabelledObjects) -> dict[str, np.ndarray]:
    """(n,) bool objects of each of KITTI's difficulty levels; an easy object is also moderate and hard.

    The 2D box must be higher than 40, 25, 25 px; occlusion at most 0, 1, 2; truncation at most 0.15, 0.30, 0.50.
    """
    return {
        name: (objects.image_height_px > height)
        & (objects.occluded >= 0)
        & (objects.occluded <= occlusion)
        & (objects.truncated <= truncation)
        for name, (height, occlusion, truncation) in zip(DIFFICULTIES, _LIMITS, strict=True)
    }
