"""Intensity as a function of brightness: random constants of surfaces, in two versions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_STATIC_EXPONENT_SIGMA = 0.15


@dataclass(frozen=True, eq=False)
class SurfaceModel:
    """Constants of (r1·G + r2)·cosⁿθ, a row an instance and a last one for the static world.

    Attributes:
        r1: (k + 1,) float32 factor of the brightness.
        r2: (k + 1,) float32 intensity of a black surface.
        exponent: (k + 1,) float32 n.
    """

    r1: np.ndarray
    r2: np.ndarray
    exponent: np.ndarray


def paper_model(rng: np.random.Generator, instances: int) -> SurfaceModel:
    """r1 ~ U(0.25, 0.5), r2 ~ U(0.2, 0.3); n ~ U(0, 8) of instances, |N(0, 0.15)| of the static world."""
    rows = instances + 1
    exponent = rng.uniform(0, 8, rows)
    exponent[-1] = abs(rng.normal(0, _STATIC_EXPONENT_SIGMA))
    return _model_of(rng.uniform(0.25, 0.5, rows), rng.uniform(0.2, 0.3, rows), exponent)


def reference_model(rng: np.random.Generator, instances: int) -> SurfaceModel:
    """The published code's constants.

    Static world: r1 = 0.4, r2 ~ U(0.2, 0.3), n = |N(0, 0.15)|. Instances: ρ·(m·G + 1 − m) with
    ρ = |N(0.15, 0.2)| within 0.08–0.5 and m ~ U(0, 1), n = |N(0.1, 1.2)| up to 3.
    """
    rows = instances + 1
    reflectivity = np.clip(np.abs(rng.normal(0.15, 0.2, rows)), 0.08, 0.5)
    mix = rng.uniform(0, 1, rows)
    exponent = np.clip(np.abs(rng.normal(0.1, 1.2, rows)), 0, 3)
    r1, r2 = reflectivity * mix, reflectivity * (1 - mix)
    r1[-1], r2[-1] = 0.4, rng.uniform(0.2, 0.3)
    exponent[-1] = abs(rng.normal(0, _STATIC_EXPONENT_SIGMA))
    return _model_of(r1, r2, exponent)


def _model_of(r1: np.ndarray, r2: np.ndarray, exponent: np.ndarray) -> SurfaceModel:
    return SurfaceModel(r1.astype(np.float32), r2.astype(np.float32), exponent.astype(np.float32))


LAWS: dict[str, Callable[[np.random.Generator, int], SurfaceModel]] = {
    "paper": paper_model,
    "reference": reference_model,
}
