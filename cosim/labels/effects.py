"""Apply the label effects of a sensor model to labels."""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti.calibration import Calibration
from cosim.drives.kitti.labels import DONT_CARE, Labels
from cosim.labels.labelling import dont_care_where
from sensors.label_boxes import LabelBoxes
from sensors.sensor_model import SensorModel

EXACT = "label_2_exact"
"""Folder of the labels before label effects, written in addition to `label_2` if a sensor has such effects."""


def relabelled(
    labels: Labels, sensor: SensorModel, points: np.ndarray, calibration: Calibration, rng: np.random.Generator
) -> Labels:
    """Apply the label effects of a sensor to the labels of a frame; 2D boxes, occlusion and truncation are unchanged.

    Args:
        labels: exact labels; `DontCare` regions are unchanged and come last.
        sensor: sensor model; its label effects are applied in the order of their phases.
        points: (n, ≥ 3) points of the frame in LiDAR axes [m].
        calibration: calibration of the frame.
        rng: generator for random effects.

    Raises:
        SensorError: a user-defined effect returns invalid labels.
    """
    is_object = np.array([name != DONT_CARE for name in labels.type], bool)
    objects = labels[is_object]
    boxes = objects.boxes_velo(calibration)
    kept = np.ones(len(boxes), bool)
    before = LabelBoxes(objects.type, boxes.centre, boxes.size, boxes.yaw, kept, np.asarray(points)[:, :3])
    after = sensor.relabel(before, rng)
    changed = Labels.from_boxes(
        type(boxes)(after.centre, after.size, after.yaw),
        objects.type,
        calibration,
        bbox=objects.bbox,
        truncated=objects.truncated,
        occluded=objects.occluded,
    )
    return dont_care_where(changed, ~after.kept).followed_by(labels[~is_object])


def difficulties(labels: Labels) -> dict[str, int]:
    """Count the easy, moderate and hard labels of cars, pedestrians and cyclists by KITTI's rules.

    Minimum height 40, 25, 25 px; maximum occlusion 0, 1, 2; maximum truncation 0.15, 0.30, 0.50 (KITTI object
    development kit, readme.txt). Each label is counted once, at its easiest level.
    """
    height = labels.bbox[:, 3] - labels.bbox[:, 1]
    remaining = np.isin(labels.type, ("Car", "Pedestrian", "Cyclist")) if len(labels) else np.zeros(0, bool)
    counts = {}
    for name, min_height, occlusion, truncation in _LEVELS:
        at_level = remaining & (height >= min_height)
        at_level &= (labels.occluded <= occlusion) & (labels.truncated <= truncation)
        counts[name] = int(at_level.sum())
        remaining = remaining & ~at_level
    return counts


_LEVELS = (("easy", 40, 0, 0.15), ("moderate", 25, 1, 0.30), ("hard", 25, 2, 0.50))
