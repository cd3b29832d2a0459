"""Construction of detectors by name."""

from __future__ import annotations

from collections.abc import Sequence

from torch import nn

from training.models.detector import Detector
from training.models.pillar_detector import PillarDetector
from training.models.settings import ModelSettings
from training.models.voxel_rcnn import VoxelRcnn


def build_detector(settings: ModelSettings, classes: Sequence[str]) -> Detector:
    """Build a detector with random weights.

    Raises:
        TrainingError: a class without anchors.
    """
    kind = VoxelRcnn if settings.name == "voxel_rcnn" else PillarDetector
    detector = kind(settings, classes)
    for module in detector.modules():
        if isinstance(module, nn.BatchNorm1d | nn.BatchNorm2d):
            module.momentum = settings.norm_momentum
    return detector
