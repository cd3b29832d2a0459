"""One physical effect a file, in rooms as light meets them, and what a user's own effect derives from."""

from sensors.effects.base import (
    BeamEffect,
    DetectionEffect,
    EchoEffect,
    Effect,
    LabelEffect,
    NoiseEffect,
    NoiseScaleEffect,
    Parameter,
    PointEffect,
    RoundingEffect,
    ScanEffect,
    number,
    per_axis,
    per_ring,
)
from sensors.effects.moved import know_old_names
from sensors.effects.phases import Phase

__all__ = [
    "BeamEffect",
    "DetectionEffect",
    "EchoEffect",
    "Effect",
    "LabelEffect",
    "NoiseEffect",
    "NoiseScaleEffect",
    "Parameter",
    "Phase",
    "PointEffect",
    "RoundingEffect",
    "ScanEffect",
    "number",
    "per_axis",
    "per_ring",
]

know_old_names()
