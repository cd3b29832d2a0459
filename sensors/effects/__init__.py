"""Physical effects, one per file, in folders by stage, and base classes for user-defined effects."""

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
