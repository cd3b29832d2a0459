"""A few frames of boxes on flat ground, written as a KITTI folder: small enough to be learnt by heart in seconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.drives.kitti import (
    Boxes,
    Calibration,
    Labels,
    clip_boxes,
    project_corners,
    write_calibration,
    write_labels,
    write_points,
)

CALIBRATION = Calibration(
    P2=np.array([[721.5, 0, 609.6, 0], [0, 721.5, 172.9, 0], [0, 0, 1, 0]]),
    R0_rect=np.eye(3),
    Tr_velo_to_cam=np.array([[0.0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, -0.27]]),
)
GROUND_M = -1.7


def car_points(box: np.ndarray, rng: np.random.Generator, count: int = 250) -> np.ndarray:
    """Points (n, 4) on the sides and the roof of a box (7,)."""
    face = rng.integers(0, 5, count)
    position = rng.uniform(-0.5, 0.5, (count, 3))
    position[face == 0, 0], position[face == 1, 0] = 0.5, -0.5
    position[face == 2, 1], position[face == 3, 1] = 0.5, -0.5
    position[face == 4, 2] = 0.5
    position *= box[3:6] * 0.98
    c, s = np.cos(box[6]), np.sin(box[6])
    x, y = c * position[:, 0] - s * position[:, 1], s * position[:, 0] + c * position[:, 1]
    return np.column_stack([x, y, position[:, 2], np.zeros(count)]) + np.array([*box[:3], 0.3])


def scene(rng: np.random.Generator, cars: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 4) float32 and boxes (cars, 7) of one frame."""
    boxes = np.zeros((cars, 7))
    boxes[:, 0] = np.linspace(8, 20, cars) + rng.uniform(-1, 1, cars)
    boxes[:, 1] = rng.uniform(-0.2, 0.2, cars) * boxes[:, 0]
    boxes[:, 3:6] = rng.normal([3.9, 1.62, 1.55], [0.2, 0.05, 0.05], (cars, 3))
    boxes[:, 2] = GROUND_M + boxes[:, 5] / 2
    boxes[:, 6] = rng.uniform(-3.1, 3.1, cars)
    ground = np.column_stack([rng.uniform(3, 25, 1500), rng.uniform(-12, 12, 1500), np.full(1500, GROUND_M)])
    ground = np.column_stack([ground, np.full(1500, 0.2)])
    return np.concatenate([ground, *(car_points(box, rng) for box in boxes)]).astype(np.float32), boxes


def write_drive(folder: Path, frames: int = 4, seed: int = 0) -> Path:
    """Write such frames; returns the folder."""
    rng = np.random.default_rng(seed)
    for part in ("velodyne", "calib", "label_2", "ImageSets"):
        (folder / part).mkdir(parents=True)
    for number in range(frames):
        points, table = scene(rng)
        boxes = Boxes(table[:, :3], table[:, 3:6], table[:, 6])
        plain = Labels.from_boxes(boxes, ["Car"] * len(boxes), CALIBRATION)
        outline = clip_boxes(project_corners(plain.corners_rect, CALIBRATION.P2), 1242, 375)
        labels = Labels.from_boxes(boxes, ["Car"] * len(boxes), CALIBRATION, bbox=outline)
        write_points(folder / "velodyne" / f"{number:06d}.bin", points)
        write_calibration(folder / "calib" / f"{number:06d}.txt", CALIBRATION)
        write_labels(folder / "label_2" / f"{number:06d}.txt", labels, 4)
    names = [f"{number:06d}\n" for number in range(frames)]
    (folder / "ImageSets" / "train.txt").write_text("".join(names))
    return folder
