"""Parts of the own vehicle block the lowest beams."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class OwnShadow(EchoEffect):
    """Beams of an azimuth sector below an elevation hit roof, rack or antenna, nearer than the minimum range.

    Azimuth and elevation are those of the nominal beam in sensor axes. One entry per part.
    """

    name: ClassVar = "own_shadow"
    phase: ClassVar = Phase.DROPOUT
    channel: ClassVar = "drop"
    equation: ClassVar = "lost where |azimuth − azimuth₀| ≤ width/2 and elevation < top"
    reference: ClassVar = "silhouette of the vehicle in KITTI's scans: the same beams are lost in all of them"
    taxonomy: ClassVar = "sp9"
    confusable_with: ClassVar = ("random_dropout", "own_silhouette")
    repeatable: ClassVar = True
    example: ClassVar = {"azimuth_deg": 180.0, "width_deg": 50.0, "top_deg": -10.0}
    neutral: ClassVar = {"azimuth_deg": 180.0, "width_deg": 0.0, "top_deg": -10.0}
    is_candidate: ClassVar = False

    azimuth_deg: float = number("middle of the part, counter-clockwise from forward", unit="°", ge=-360, le=360)
    width_deg: float = number("width of the part", unit="°", ge=0, le=360)
    top_deg: float = number("elevation below which it hides the world", unit="°", ge=-90, le=90)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns that no part hides."""
        azimuth = shot.rays.azimuth[returns.beam].astype(np.float64) - np.radians(self.azimuth_deg)
        away = np.abs(np.angle(np.exp(1j * azimuth)))
        elevation = np.degrees(np.arcsin(shot.rays.direction[returns.beam, 2]))
        return returns.take((away >= np.radians(self.width_deg / 2)) | (elevation >= self.top_deg))
