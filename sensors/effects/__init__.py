"""One physical effect a file, and what a user's own effect derives from."""

from sensors.effects.base import (
    BeamEffect,
    EchoEffect,
    Effect,
    LabelEffect,
    Parameter,
    PointEffect,
    ScanEffect,
    number,
    per_axis,
    per_ring,
)
from sensors.effects.phases import Phase

__all__ = [
    "BeamEffect",
    "EchoEffect",
    "Effect",
    "LabelEffect",
    "Parameter",
    "Phase",
    "PointEffect",
    "ScanEffect",
    "number",
    "per_axis",
    "per_ring",
]
