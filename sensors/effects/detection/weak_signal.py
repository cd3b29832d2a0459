"""Intensities of weak echoes are reported too low, those of the weakest as zero."""

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


class WeakSignal(EchoEffect):
    """I·D, D = 1/(1 + (signals[ring]/S')^k), 0 where D < least[ring]; S' = S·exp(σ·f(p/c)), S the signal before gains.

    In KITTI's scans lasers differ little in what they report of bright surfaces (nine tenths lie below 0.29 to 0.46)
    and much in their weak reports: those of a weak laser spread from 0.03 to 0.31 on a road where a strong one reports
    0.27 to 0.42. Zeros come in patches: a zero follows a zero in 93 % of cases and another value in 1 %. So what
    decides is smooth in space: f is a Gaussian random field of unit variance, fixed to the surface; retro-reflectors
    are excepted.
    """

    name: ClassVar = "weak_signal"
    phase: ClassVar = Phase.WEAK_SIGNAL
    channel: ClassVar = "intensity"
    equation: ClassVar = "I·D, 0 where D < least[ring]; D = 1/(1 + (signals[ring]/(S·exp(σ·f(p/c))))^k)"
    reference: ClassVar = "Velodyne HDL-64E S2 calibration, minIntensity by laser; runs of zeros in KITTI's scans"
    taxonomy: ClassVar = "di3"
    confusable_with: ClassVar = ("intensity_floor", "pulse_detection")
    needs_new_rays: ClassVar = True  # places on moving objects need their poses
    has_texture: ClassVar = True
    example: ClassVar = {
        "signals": (0.05, 0.1) * 32,
        "steepness": 8.0,
        "least": (0.003, 0.1) * 32,
        "sigma": 0.5,
        "cell_m": 0.1,
    }
    is_candidate: ClassVar = False

    signals: bounded(0, 10) = per_ring("signal of each laser at which D = 1/2, ring 0 first")  # type: ignore[valid-type]
    steepness: float = number("k, how quickly D falls with the signal", ge=0.1, le=50)
    least: bounded(0, 0.9) = per_ring("D of each laser below which zero is reported")  # type: ignore[valid-type]
    sigma: float = number("σ, spread of the logarithm of what the signal is compared with", ge=0, le=3)
    cell_m: float = number("c, cell of the field; its features are 2 to 128 cells large", unit="m", ge=0.01, le=10)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns with lower intensities of weak ones."""
        signal = np.maximum(returns.intensity, np.float32(1e-9))
        if self.sigma:
            places = points_on_surface(returns, shot)
            signal = signal * np.exp(np.float32(self.sigma) * field_at(places, self.cell_m, (71, 71, 71)))
        ring = shot.rays.ring[returns.beam]
        half = np.array(self.signals, np.float32)[ring]
        share = 1 / (1 + np.minimum(half / signal, np.float32(10)) ** np.float32(self.steepness))
        share[share < np.array(self.least, np.float32)[ring]] = 0
        share[shot.is_material("retro", returns)] = 1
        return replace(returns, intensity=returns.intensity * share)
