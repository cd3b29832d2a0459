"""Sets of known content, on disk and in memory."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Boxes, Calibration, Labels, write_calibration, write_labels, write_points
from cosim.stats import Collected, LabelledObjects
from cosim.stats.tally import Scans

CALIBRATION = Calibration(
    P2=np.array([[700, 0, 80, 0], [0, 700, 50, 0], [0, 0, 1, 0]], float),
    R0_rect=np.eye(3),
    Tr_velo_to_cam=np.array([[0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, -0.27]]),
)
INSIDE = 7  # points in every labelled car
ZEROS = 3  # of them with intensity 0


def write_frame(root: Path, name: str, boxes: Boxes, types: list[str], *, scan: bool = True) -> None:
    """A frame whose every object holds INSIDE points, and 5 more points lie elsewhere."""
    for part in ("label_2", "calib", *(["velodyne"] if scan else [])):
        (root / part).mkdir(parents=True, exist_ok=True)
    write_calibration(root / f"calib/{name}.txt", CALIBRATION)
    labels = Labels.from_boxes(boxes, types, CALIBRATION, bbox=np.tile([0.0, 0, 60, 60], (len(boxes), 1)))
    write_labels(root / f"label_2/{name}.txt", labels, decimals=6)
    if not scan:
        return
    offsets = np.linspace(-0.3, 0.3, INSIDE)
    rows = [[x + offset, y, z, 0.5] for x, y, z in boxes.centre for offset in offsets]
    points = np.array(rows + [[0, -5, 3, 0.25]] * 5, float).reshape(-1, 4)
    for box in range(len(boxes)):
        points[box * INSIDE : box * INSIDE + ZEROS, 3] = 0
    write_points(root / f"velodyne/{name}.bin", points)


def cars(*centres: tuple[float, float, float]) -> Boxes:
    return Boxes(np.array(centres, float), np.tile([4.0, 1.6, 1.5], (len(centres), 1)), np.zeros(len(centres)))


def cloud_of_cars(centre: np.ndarray, frame: np.ndarray, frames: int, yaw: np.ndarray | None = None) -> Collected:
    """A set of cars at given centres in LiDAR axes."""
    count = len(centre)
    objects = LabelledObjects(
        frame=frame,
        type=np.full(count, "Car"),
        size=np.tile([4.0, 1.6, 1.5], (count, 1)),
        centre=centre,
        yaw=np.zeros(count) if yaw is None else yaw,
        truncated=np.zeros(count),
        occluded=np.zeros(count, np.int64),
        bbox=np.tile([100.0, 100.0, 200.0, 150.0], (count, 1)),
        points=np.full(count, -1),
    )
    return Collected(
        *("made", "labels", "", tuple(f"{row:06d}" for row in range(frames)), np.ones(frames, bool)),
        *(np.zeros(frames, bool), objects, Counter({"Car": count}), Scans.empty(frames)),
    )
