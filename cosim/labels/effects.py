"""Labels as a sensor's label effects leave them."""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti.calibration import Calibration
from cosim.drives.kitti.labels import DONT_CARE, Labels
from cosim.labels.labelling import dont_care_where
from sensors.label_boxes import LabelBoxes
from sensors.sensor_model import SensorModel

EXACT = "label_2_exact"
"""Folder of the labels before label effects, kept beside `label_2` where a sensor has such effects."""


def relabelled(
    labels: Labels, sensor: SensorModel, points: np.ndarray, calibration: Calibration, rng: np.random.Generator
) -> Labels:
    """The labels of a frame after the label effects of a sensor; 2D boxes, occlusion and truncation stay.

    Args:
        labels: exact ones, `DontCare` regions included; those stay last and as they are.
        sensor: its label effects act in the order of their phases.
        points: (n, ≥ 3) of the frame's scan, LiDAR axes.
        calibration: of the frame.
        rng: for effects that draw.

    Raises:
        SensorError: a user's effect breaks the rules.
    """
    cared = np.array([name != DONT_CARE for name in labels.type], bool)
    objects = labels[cared]
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
    return dont_care_where(changed, ~after.kept).followed_by(labels[~cared])


def difficulties(labels: Labels) -> dict[str, int]:
    """How many labels of cars, people and cyclists are easy, moderate and hard at most, by KITTI's rules.

    Least height 40, 25, 25 px; greatest occlusion 0, 1, 2; greatest truncation 0.15, 0.30, 0.50 (KITTI object
    development kit, readme.txt). Each label counts once, at the easiest level it satisfies.
    """
    height = labels.bbox[:, 3] - labels.bbox[:, 1]
    graded = np.isin(labels.type, ("Car", "Pedestrian", "Cyclist")) if len(labels) else np.zeros(0, bool)
    found = {}
    for name, least, occlusion, truncation in _LEVELS:
        here = graded & (height >= least) & (labels.occluded <= occlusion) & (labels.truncated <= truncation)
        found[name] = int(here.sum())
        graded = graded & ~here
    return found


_LEVELS = (("easy", 40, 0, 0.15), ("moderate", 25, 1, 0.30), ("hard", 25, 2, 0.50))
