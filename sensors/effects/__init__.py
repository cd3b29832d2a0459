"""One physical effect a file, and what a user's own effect derives from."""

from sensors.effects.base import BeamEffect, EchoEffect, Effect, Parameter, PointEffect, ScanEffect, number, per_ring
from sensors.effects.phases import Phase

__all__ = [
    "BeamEffect",
    "EchoEffect",
    "Effect",
    "Parameter",
    "Phase",
    "PointEffect",
    "ScanEffect",
    "number",
    "per_ring",
]
