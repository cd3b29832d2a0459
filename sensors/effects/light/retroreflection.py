"""Plates, signs and lamps are retro-reflective."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class Retroreflection(EchoEffect):
    """I·gain on retro-reflective materials, up to saturation at 1."""

    name: ClassVar = "retroreflection"
    phase: ClassVar = Phase.RETRO
    channel: ClassVar = "intensity"
    equation: ClassVar = "I·gain on retro materials"
    reference: ClassVar = "Muckenhuber et al.: Automotive lidar modelling by material properties, Sensors 2020"
    taxonomy: ClassVar = "sp47"
    confusable_with: ClassVar = ("blooming", "projected_intensity")
    example: ClassVar = {"gain": 5.0}
    neutral: ClassVar = {"gain": 1.0}

    gain: float = number("how much more a retro-reflector returns", ge=0, le=1000)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with brighter retro-reflectors."""
        retro = shot.is_material("retro", returns)
        return replace(returns, intensity=np.where(retro, returns.intensity * np.float32(self.gain), returns.intensity))
