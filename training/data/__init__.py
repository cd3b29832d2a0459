"""Training data: reading, augmentation, batching and voxelisation. Importing this package does not import torch."""

from training.data.augment import Augment, augment
from training.data.frame import IGNORED, TrainingSample, read_sample
from training.data.object_bank import ObjectBank
from training.data.source import FrameSource, read_samples

__all__ = [
    "IGNORED",
    "Augment",
    "FrameSource",
    "ObjectBank",
    "TrainingSample",
    "augment",
    "read_sample",
    "read_samples",
]
