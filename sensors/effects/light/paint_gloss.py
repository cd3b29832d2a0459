"""Varnished paint reflects a part of the light specularly."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class PaintGloss(EchoEffect):
    """On `paint` materials I·((1 − gloss) + gloss·cosⁿθ): a varnished surface is bright only at normal incidence."""

    name: ClassVar = "paint_gloss"
    phase: ClassVar = Phase.GLOSS
    channel: ClassVar = "intensity"
    equation: ClassVar = "I·((1 − gloss) + gloss·cosⁿθ) on paint"
    reference: ClassVar = "Schlick: An inexpensive BRDF model for physically-based rendering, Eurographics 1994"
    taxonomy: ClassVar = "sp47"
    confusable_with: ClassVar = ("incidence_falloff", "projected_intensity")
    example: ClassVar = {"gloss": 0.8, "exponent": 8.0}
    neutral: ClassVar = {"gloss": 0.0, "exponent": 8.0}
    is_candidate: ClassVar = False

    gloss: float = number("share of the light in the glossy lobe", ge=0, le=1)
    exponent: float = number("n, narrowness of the lobe", ge=0, le=200)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns of paint attenuated by incidence."""
        lobe = 1 - self.gloss + self.gloss * shot.cos_incidence(returns) ** np.float32(self.exponent)
        painted = shot.is_material("paint", returns)
        return replace(
            returns, intensity=np.where(painted, returns.intensity * lobe, returns.intensity).astype(np.float32)
        )
