"""Weak echoes are ranged, but their intensity is reported as zero."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, bounded, number, per_ring
from sensors.effects.material_groups import points_on_surface
from sensors.effects.phases import Phase
from sensors.effects.spatial_noise import field_at
from sensors.returns import Returns
from sensors.shot import Shot


class ZeroReport(EchoEffect):
    """I → 0 where S·exp(σ·f(p/c)) < signals[ring], S being the signal before the lasers' gains and the compression.

    In KITTI's scans zeros come in patches: a zero follows a zero in 93 % of cases and another value in 1 %, and values
    beside a zero are as often large as small. So the signal that decides is smooth in space and is not the reported
    intensity. f is a Gaussian random field of unit variance, fixed to the surface. Retro-reflectors are never zero.
    """

    name: ClassVar = "zero_report"
    phase: ClassVar = Phase.ZERO_REPORT
    channel: ClassVar = "intensity"
    equation: ClassVar = "I → 0 where S·exp(σ·f(p/c)) < signals[ring]"
    reference: ClassVar = "Velodyne HDL-64E S2 calibration, minIntensity by laser; runs of zeros in KITTI's scans"
    taxonomy: ClassVar = "di3"
    confusable_with: ClassVar = ("intensity_floor", "pulse_detection")
    needs_new_rays: ClassVar = True  # places on moving objects need their poses
    example: ClassVar = {"signals": (0.05, 0.1) * 32, "sigma": 0.5, "cell_m": 0.1}
    is_candidate: ClassVar = False

    signals: bounded(0, 10) = per_ring("least signal of each laser whose intensity is reported")  # type: ignore[valid-type]
    sigma: float = number("σ, spread of the logarithm of what the signal is compared with", ge=0, le=3)
    cell_m: float = number("c, cell of the field; its features are 2 to 128 cells large", unit="m", ge=0.01, le=10)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """The same returns, the weakest with intensity 0."""
        signal = returns.intensity
        if self.sigma:
            places = points_on_surface(returns, shot)
            signal = signal * np.exp(np.float32(self.sigma) * field_at(places, self.cell_m, (71, 71, 71)))
        weak = signal < np.array(self.signals, np.float32)[shot.rays.ring[returns.beam]]
        weak &= ~shot.is_material("retro", returns)
        return replace(returns, intensity=np.where(weak, np.float32(0), returns.intensity))
