"""Random augmentation of training frames."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from cosim.drives.kitti import points_in_boxes, wrap_angle
from training.data.frame import TrainingSample
from training.data.object_bank import ObjectBank, as_boxes


class Augment(BaseModel):
    """Settings of the augmentation."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    flip: float = Field(default=0.5, ge=0, le=1, description="probability of a left-right flip")
    rotation_deg: float = Field(default=45.0, ge=0, le=180, description="maximum rotation about z [deg]")
    scale: float = Field(default=0.05, ge=0, lt=0.5, description="maximum relative change of scale")
    samples: dict[str, int] = Field(
        default_factory=lambda: {"Car": 10, "Pedestrian": 8, "Cyclist": 8},
        description="objects of other frames are inserted until a frame has this number of each class",
    )
    object_scale: float = Field(
        default=0.0,
        ge=0,
        lt=0.5,
        description="maximum relative change of the length, width and height of each object, drawn independently",
    )
    tilt_deg: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="standard deviation of a tilt along and across the direction of travel [deg]",
    )
    lift_m: float = Field(
        default=0.0, ge=0, le=2, description="standard deviation of a vertical shift of the frame [m]"
    )
    drop_points: float = Field(default=0.0, ge=0, lt=1, description="maximum share of points that are dropped")
    intensity_gain: float = Field(default=0.0, ge=0, lt=1, description="maximum relative change of intensities")

    @classmethod
    def none(cls) -> Augment:
        """No augmentation."""
        return cls(flip=0, rotation_deg=0, scale=0, samples={})


def augment(
    sample: TrainingSample, settings: Augment, bank: ObjectBank | None, rng: np.random.Generator
) -> TrainingSample:
    """Insert objects into a frame, then flip, rotate and scale the whole frame."""
    if bank is not None:
        sample = bank.fill(sample, rng)
    points, boxes = sample.points.copy(), sample.boxes.copy()
    if settings.object_scale:
        _resize(points, boxes, rng.uniform(1 - settings.object_scale, 1 + settings.object_scale, (len(boxes), 3)))
    if rng.random() < settings.flip:
        points[:, 1] *= -1
        boxes[:, 1] *= -1
        boxes[:, 6] *= -1
    limit = np.radians(settings.rotation_deg)
    points, boxes = _rotate(points, boxes, rng.uniform(-limit, limit))
    _tilt(points, boxes, np.tan(np.radians(rng.normal(0, settings.tilt_deg, 2))), rng.normal(0, settings.lift_m))
    factor = rng.uniform(1 - settings.scale, 1 + settings.scale)
    points[:, :3] *= factor
    boxes[:, :6] *= factor
    kept = rng.random(len(points)) >= rng.uniform(0, settings.drop_points)
    points = rng.permutation(points[kept])  # random order: decides which points a limited cell drops
    gain = rng.uniform(1 - settings.intensity_gain, 1 + settings.intensity_gain)
    points[:, 3] = np.clip(points[:, 3] * gain, 0, 1)
    boxes[:, 6] = wrap_angle(boxes[:, 6])
    return TrainingSample(sample.name, points, boxes, sample.class_ids)


def _tilt(points: np.ndarray, boxes: np.ndarray, slope: np.ndarray, lift_m: float) -> None:
    """Add a slope along x and y to all heights (first order in the slope); boxes stay upright, as labels are."""
    for table in (points, boxes):
        table[:, 2] += (table[:, :2] @ slope + lift_m).astype(np.float32)


def _resize(points: np.ndarray, boxes: np.ndarray, factors: np.ndarray) -> None:
    """Scale boxes (m, 7) and the points in them by factors (m, 3) along their axes, about the centre of their bottom.

    Cars of different regions differ in size: Wang et al., "Train in Germany, Test in the USA", CVPR 2020; Yang et al.,
    "ST3D", CVPR 2021, section 3.2.
    """
    inside = points_in_boxes(points, as_boxes(boxes))
    for box, mask, factor in zip(boxes, inside, factors.astype(np.float32), strict=True):
        cos, sin = np.cos(box[6]), np.sin(box[6])
        turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]], np.float32)
        bottom = box[:3] - [0, 0, box[5] / 2]
        points[mask, :3] = ((points[mask, :3] - bottom) @ turn.T * factor) @ turn + bottom
        box[3:6] *= factor
        box[2] = bottom[2] + box[5] / 2


def _rotate(points: np.ndarray, boxes: np.ndarray, angle_rad: float) -> tuple[np.ndarray, np.ndarray]:
    cos, sin = np.float32(np.cos(angle_rad)), np.float32(np.sin(angle_rad))
    for table in (points, boxes):
        x, y = table[:, 0].copy(), table[:, 1].copy()
        table[:, 0], table[:, 1] = cos * x - sin * y, sin * x + cos * y
    boxes[:, 6] += np.float32(angle_rad)
    return points, boxes
