"""Intensity computed from the brightness in the camera image, with random constants of surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot

_REFLECTOR = 10.0  # saturates out to 108 m where a line to 120 m weakens it
_LEAST_AHEAD = -0.2  # cosine; beams that turn farther from the camera's view are not looked up
_STATIC_EXPONENT_SIGMA = 0.15


class ProjectedIntensity(EchoEffect):
    """I = (r1·G + r2)·cosⁿθ, G the grayscale image 0–1 where the camera sees the point.

    r1, r2 and n are drawn again in each frame: one set for the static world, one for each vehicle or person, whose
    reflectivity is its r1 and whose brightness its r2. `paper`: r1 ∈ [0.25, 0.5], r2 ∈ [0.2, 0.3], and for
    instances n ∈ [0, 8]; for the static world n = |N(0, 0.15)| as in the published code, since a road 10 m ahead is
    seen at cos θ = 0.17 and would be black otherwise. `reference`: the constants of that code.

    A point is seen if the depth image has its depth there. Elsewhere G = s·√albedo (of paint: √reflectance), √
    because images are so encoded, s the median of G/√albedo over what is seen, and 1 without a camera. Reflectors
    answer with 10, which saturates: points in pixels that outshine their surroundings, and retro materials, since
    the sun is seldom in that direction.
    """

    name: ClassVar = "projected_intensity"
    phase: ClassVar = Phase.PROJECTION
    channel: ClassVar = "intensity"
    needs_camera: ClassVar = True
    equation: ClassVar = "(r1·G + r2)·cosⁿθ"
    reference: ClassVar = "Synth It Like KITTI, arXiv:2502.15076, intensity model"
    confusable_with: ClassVar = ("incidence_falloff", "paint_gloss", "retroreflection")
    example: ClassVar = {"preset": "paper", "gain": 1.0, "peak_threshold": 0.8, "peak_contrast": 0.35}
    is_candidate: ClassVar = False

    preset: Literal["paper", "reference"] = Field(description="from whom the constants are")
    gain: float = number("factor on all but reflectors", ge=0.05, le=5)
    peak_threshold: float = number("least brightness of a reflector's pixel; 1.01 for none", ge=0.1, le=1.01)
    peak_contrast: float = number("how much brighter than the 41 × 41 pixels around", ge=0, le=1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with intensities from the camera image."""
        things = len(shot.hits.paint)
        law = _LAWS[self.preset](rng, things)
        gray, reflector = self._brightness(returns, shot)
        # The last row is that of the static world, −1, and of points that no surface gave, −2.
        row = np.where(returns.instance >= 0, returns.instance, things)
        cos = shot.cos_incidence(returns)
        level = law.r1[row]
        level *= gray
        level += law.r2[row]
        level *= cos ** law.exponent[row]
        level *= np.float32(self.gain)
        level[reflector] = _REFLECTOR
        return replace(returns, intensity=level)

    def _brightness(self, returns: Returns, shot: Shot) -> tuple[np.ndarray, np.ndarray]:
        """G (m,) float32 and (m,) bool, whether the surface is a reflector."""
        painted = shot.is_material("paint", returns)
        gray = np.sqrt(
            np.where(
                painted, returns.reflectance, shot.hits.table.column("albedo").astype(np.float32)[returns.material]
            )
        )
        reflector = shot.is_material("retro", returns)
        if shot.camera is None:
            return gray, reflector
        ahead = np.flatnonzero(shot.direction_in_world(returns) @ shot.camera.forward > _LEAST_AHEAD)
        seen, line, column = shot.camera.visible(shot.points_in_world(returns.take(ahead)))
        seen = ahead[seen]
        image = shot.camera.gray[line, column] * np.float32(1 / 255)
        if len(seen):
            gray *= np.median(image / np.maximum(gray[seen], np.float32(0.05)))
            np.minimum(gray, 1, out=gray)
        gray[seen] = image
        reflector[seen] |= shot.camera.peaks(self.peak_threshold, self.peak_contrast)[line, column]
        return gray, reflector


@dataclass(frozen=True, eq=False)
class _SurfaceModel:
    """Constants of (r1·G + r2)·cosⁿθ, a row an instance and a last one for the static world.

    Attributes:
        r1: (k + 1,) float32 factor of the brightness.
        r2: (k + 1,) float32 intensity of a black surface.
        exponent: (k + 1,) float32 n.
    """

    r1: np.ndarray
    r2: np.ndarray
    exponent: np.ndarray


def paper_model(rng: np.random.Generator, instances: int) -> _SurfaceModel:
    """r1 ~ U(0.25, 0.5), r2 ~ U(0.2, 0.3); n ~ U(0, 8) of instances, |N(0, 0.15)| of the static world."""
    rows = instances + 1
    exponent = rng.uniform(0, 8, rows)
    exponent[-1] = abs(rng.normal(0, _STATIC_EXPONENT_SIGMA))
    return _model_of(rng.uniform(0.25, 0.5, rows), rng.uniform(0.2, 0.3, rows), exponent)


def reference_model(rng: np.random.Generator, instances: int) -> _SurfaceModel:
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


def _model_of(r1: np.ndarray, r2: np.ndarray, exponent: np.ndarray) -> _SurfaceModel:
    return _SurfaceModel(r1.astype(np.float32), r2.astype(np.float32), exponent.astype(np.float32))


_LAWS: dict[str, Callable[[np.random.Generator, int], _SurfaceModel]] = {
    "paper": paper_model,
    "reference": reference_model,
}
