"""The order in which effects act."""

from __future__ import annotations

from enum import IntEnum, auto
from typing import Literal

Stage = Literal["beam", "echo", "point", "scan", "label", "traffic"]
Channel = Literal[
    "range",
    "range_variance",
    "azimuth_error",
    "elevation_error",
    "intensity",
    "intensity_offset",
    "intensity_variance",
    "drop",
    "spurious",
    "early",
    "late",
    "shared_range",
    "shared_azimuth_error",
    "shared_elevation_error",
    "shared_intensity",
    "shared_drop",
    "pose",
    "label",
]


class Phase(IntEnum):
    """Phase in which an effect acts; effects are sorted by it, whatever their order in the sensor file.

    User-defined effects act in the `OWN_…` phases by default.
    """

    MOUNT = auto()
    ELEVATION = auto()
    AZIMUTH = auto()
    BLOCKS = auto()
    SWEEP = auto()
    TIME = auto()
    SUSPENSION = auto()
    OWN_BEAM = auto()
    DIVERGENCE = auto()
    WET_ROAD = auto()
    PROJECTION = auto()
    GLASS = auto()
    GHOST = auto()
    SURFACE = auto()
    GLOSS = auto()
    INCIDENCE = auto()
    RANGE_FALLOFF = auto()
    LINEAR_FALLOFF = auto()
    EXTINCTION = auto()
    FOCAL_RESPONSE = auto()
    DETECTION = auto()
    WEAK_SIGNAL = auto()
    GRAIN = auto()
    RING_GAIN = auto()
    RETRO = auto()
    COMPRESSION = auto()
    OWN_ECHO = auto()
    THRESHOLD = auto()
    DROPOUT = auto()
    MAX_RANGE = auto()
    FOLIAGE = auto()
    RANGE_BIAS = auto()
    RANGE_SCALE = auto()
    RING_OFFSET = auto()
    RANGE_WALK = auto()
    INCIDENCE_BIAS = auto()
    OWN_POINT = auto()
    INTENSITY_NOISE = auto()
    INTENSITY_JITTER = auto()
    RANGE_NOISE = auto()
    NOISE_SCALE = auto()
    SHARED_NOISE = auto()
    DETECTOR_FLOOR = auto()
    CUTOFF = auto()
    BACKSCATTER = auto()
    FALSE_ALARMS = auto()
    BLOOMING = auto()
    OWN_SCAN = auto()
    ROUNDING = auto()
    DOWNSAMPLING = auto()
    BOX_SHRINK = auto()
    FEW_POINTS = auto()
    OWN_LABEL = auto()


CLIP_BEFORE = (Phase.THRESHOLD, Phase.INTENSITY_NOISE, Phase.ROUNDING)
"""Intensity is clipped to 0–1 before the first effect at or after each of these, and at the end."""
