"""Run a detector, and convert its detections to KITTI labels with scores."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import torch

from cosim.drives.kitti import Boxes, Frame, Labels, box_areas, clip_boxes, project_corners, write_labels
from cosim.drives.writer import explained
from training.data.batch import collate
from training.data.frame import image_size, read_sample
from training.models.detector import Detector
from training.models.nms import Detections


def predict(
    detector: Detector,
    frames: Iterable[Frame],
    classes: Sequence[str],
    device: torch.device,
    *,
    least_score: float = 0.05,
    on_frame: Callable[[], None] = lambda: None,
) -> list[Labels]:
    """Detect objects frame by frame."""
    detector.eval()
    detected = []
    for frame in frames:
        batch = collate([read_sample(frame, classes)]).to(device)
        detected.append(to_labels(detector.detect(batch, least_score)[0], frame, classes))
        on_frame()
    return detected


def to_labels(detections: Detections, frame: Frame, classes: Sequence[str]) -> Labels:
    """Convert detections to KITTI labels with image boxes; those outside the image are dropped."""
    table = detections.boxes.astype(np.float64)
    boxes = Boxes(table[:, :3], table[:, 3:6], table[:, 6])
    class_ids = [classes[int(kind)] for kind in detections.class_ids]
    labels = Labels.from_boxes(boxes, class_ids, frame.calibration, score=detections.scores.astype(np.float64))
    outline = clip_boxes(project_corners(labels.corners_rect, frame.calibration.P2), *image_size(frame))
    is_visible = np.nan_to_num(box_areas(outline)) > 0
    seen = Labels.from_boxes(
        boxes[is_visible],
        [kind for kind, visible in zip(class_ids, is_visible, strict=True) if visible],
        frame.calibration,
        bbox=outline[is_visible],
        truncated=-1.0,
        occluded=-1,
        score=detections.scores[is_visible].astype(np.float64),
    )
    return seen


def write_detections(folder: Path, names: Sequence[str], detected: Sequence[Labels]) -> None:
    """Write one NAME.txt per frame, for `cosim evaluate`."""
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, labels in zip(names, detected, strict=True):
            write_labels(folder / f"{name}.txt", labels, 4)
