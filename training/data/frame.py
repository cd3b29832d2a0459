"""One frame as input of a detector: points in the camera's field of view, and boxes in LiDAR axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.drives.kitti import Frame, points_in_boxes
from training.evaluation.rules import NEIGHBOURS

#: Class index of objects that are neither positives nor background.
IGNORED = -1
_DEFAULT_SIZE_PX = (1242, 375)


@dataclass(frozen=True, eq=False)
class TrainingSample:
    """A frame to learn from.

    Attributes:
        name: of the frame.
        points: (n, 4) float32 x, y, z [m] in LiDAR axes and intensity.
        boxes: (m, 7) float32 centre x, y, z, length, width, height [m], yaw [rad].
        kinds: (m,) int64 index of the class, −1 for objects to be ignored.
    """

    name: str
    points: np.ndarray
    boxes: np.ndarray
    class_ids: np.ndarray


def image_size(frame: Frame) -> tuple[int, int]:
    """Width and height [px] of the left colour camera: of the frame's image, otherwise KITTI's default."""
    path = frame.find("image_2")
    if path is None:
        return _DEFAULT_SIZE_PX
    with path.open("rb") as file:
        header = file.read(24)
    if header[12:16] == b"IHDR":  # the header of a PNG contains its size
        return int.from_bytes(header[16:20], "big"), int.from_bytes(header[20:24], "big")
    height, width = frame.image("image_2").shape[:2]
    return width, height


def in_view(frame: Frame, points: np.ndarray) -> np.ndarray:
    """Mask of points (n, ≥ 3) in the left colour image, (n,) bool: KITTI labels nothing outside of it."""
    width, height = image_size(frame)
    uv, depth = frame.calibration.project(points)
    u, v = uv.T
    with np.errstate(invalid="ignore"):
        return (depth > 0) & (u >= 0) & (u < width) & (v >= 0) & (v < height)


def read_sample(frame: Frame, classes: Sequence[str], min_points: int = 5) -> TrainingSample:
    """Read a frame.

    Args:
        frame: frame of a drive or of a recording; without labels there are no boxes.
        classes: classes to detect; their neighbouring classes (Van for Car) are ignored.
        min_points: objects with fewer points are ignored.
    """
    points = frame.points
    ahead = points[points[:, 0] > 0]
    seen = ahead[in_view(frame, ahead)]
    if not frame.has("label_2"):
        return TrainingSample(frame.name, seen, np.zeros((0, 7), np.float32), np.zeros(0, np.int64))
    indices = {name.lower(): number for number, name in enumerate(classes)}
    neighbours = {(NEIGHBOURS.get(name) or "").lower() for name in classes}
    labels = frame.labels.of_type(*indices, *(neighbours - {""}))
    class_ids = np.array([indices.get(name.lower(), IGNORED) for name in labels.type], np.int64)
    boxes = labels.boxes_velo(frame.calibration)
    few = points_in_boxes(seen, boxes).sum(1) < min_points
    class_ids[few] = IGNORED
    table = np.column_stack([boxes.centre, boxes.size, boxes.yaw]).astype(np.float32)
    return TrainingSample(frame.name, seen, table.reshape(-1, 7), class_ids)
