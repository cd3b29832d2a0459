"""The receiver's lens is sharp at one distance: near targets are blurred beyond the detector."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class ReceiverFocus(EchoEffect):
    """I·s(R)/s(R*), s(R) = 1/(R² + w²(1 − R/f)²), R* = f·w²/(f² + w²) where s is greatest.

    Light from a diffuse target falls with 1/R². A lens focused at f images it as a blur whose width grows with
    |1/R − 1/f|, so a detector takes in the share 1/(1 + w²(1/R − 1/f)²). Their product is flat up to about R* and falls
    with 1/R² beyond. `blur_m` is w, the distance below which blur rather than distance rules.
    """

    name: ClassVar = "receiver_focus"
    phase: ClassVar = Phase.RANGE_FALLOFF
    channel: ClassVar = "intensity"
    equation: ClassVar = "I·(R*² + w²(1 − R*/f)²)/(R² + w²(1 − R/f)²)"
    reference: ClassVar = (
        "Biavati et al.: Correction scheme for close-range lidar returns, Applied Optics 2011; thin-lens blur"
    )
    taxonomy: ClassVar = "sp2"
    confusable_with: ClassVar = ("range_falloff", "focal_response", "atmospheric_extinction")
    example: ClassVar = {"focus_m": 40.0, "blur_m": 30.0}
    is_candidate: ClassVar = False

    focus_m: float = number("f, distance of sharpest focus", unit="m", ge=1, le=1000)
    blur_m: float = number("w, distance below which blur rules", unit="m", ge=0.1, le=1000)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns attenuated far beyond the focus and before it."""
        f, w = self.focus_m, self.blur_m
        best = f * w**2 / (f**2 + w**2)
        signal = self._inverse(best) / self._inverse(returns.range_m)
        return replace(returns, intensity=returns.intensity * np.asarray(signal, np.float32))

    def _inverse(self, range_m: np.ndarray | float) -> np.ndarray | float:
        return range_m**2 + self.blur_m**2 * (1 - range_m / self.focus_m) ** 2
