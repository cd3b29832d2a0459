"""The rules of KITTI's object benchmark: classes, difficulties, overlaps demanded (devkit, evaluate_object.cpp)."""

from __future__ import annotations

from typing import Literal

Metric = Literal["2d", "bev", "3d"]

METRICS: tuple[Metric, ...] = ("3d", "bev", "2d")
DIFFICULTIES = ("easy", "moderate", "hard")
CLASSES = ("Car", "Pedestrian", "Cyclist")

#: What is neither hit nor miss when a class is scored.
NEIGHBOURS = {"Car": "Van", "Pedestrian": "Person_sitting", "Cyclist": None}
MIN_OVERLAP = {"Car": 0.7, "Pedestrian": 0.5, "Cyclist": 0.5}
MIN_HEIGHT_PX = (40.0, 25.0, 25.0)
MAX_OCCLUSION = (0, 1, 2)
MAX_TRUNCATION = (0.15, 0.30, 0.50)
#: Score thresholds, and slots of a precision curve.
SAMPLES = 41
#: An alpha of this value says that a detection has no orientation.
NO_ALPHA = -10.0
