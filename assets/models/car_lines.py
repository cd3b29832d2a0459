"""Lengthwise lines of a car body, sampled at its cross-sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.models.catalogue import ModelSpec
from assets.models.plan import ARCH_GAP_M, arch_rise, plan_outline, sections
from assets.models.styles import BodyStyle, Line

MIRROR_REACH_M = 0.03  # how far a mirror extends beyond the side
PLATE_REACH_M = 0.008  # how far a number plate extends beyond the bumper


@dataclass(frozen=True)
class CarLines:
    """Lines of a body at its c cross-sections, all (c,) in metres unless said.

    Attributes:
        behind: distance behind the nose.
        x: position in the model's frame.
        half_width: largest half-width of the section.
        normal: (c, 2) outward direction of the plan outline, x and y.
        bottom: lower edge of the flank: the underbody, or the wheel arch.
        belt: shoulder line.
        crest: upper edge of the flank.
        bow: how far the centre line lies ahead of the crest.
        in_arch: (c,) bool, inside a wheel arch.
    """

    behind: np.ndarray
    x: np.ndarray
    half_width: np.ndarray
    normal: np.ndarray
    bottom: np.ndarray
    belt: np.ndarray
    crest: np.ndarray
    bow: np.ndarray
    in_arch: np.ndarray


def car_lines(spec: ModelSpec, style: BodyStyle) -> CarLines:
    """Sample the lines of `style` at sections fit for the dimensions of `spec`."""
    length = spec.length_m - 2 * PLATE_REACH_M
    flank = spec.width_m / 2 - MIRROR_REACH_M
    behind = _sections(spec, style, length)
    half_width, normal = plan_outline(behind, length, flank, style.nose, style.tail)
    radius = style.wheel_radius_m(spec) + ARCH_GAP_M
    rise = style.wheel_radius_m(spec) + radius - style.clearance_m
    arch = np.max([arch_rise(behind, axle, radius, rise) for axle in _axles(spec, length)], axis=0)
    ends = 0.03 * (1 - _smooth_step(0.1, 0.45, behind)) + 0.05 * _smooth_step(length - 0.4, length, behind)
    share = behind / length
    glass_end = style.backlight[0]
    bow = (
        0.16 * _smooth_step(0.05, style.windscreen[0], share)
        - 0.10 * _smooth_step(style.windscreen[0], style.windscreen[1] + 0.05, share)
        - 0.10 * _smooth_step(style.windscreen[1] + 0.05, glass_end, share)
        + 0.04 * _smooth_step(glass_end, 1.0, share)
    )
    return CarLines(
        behind=behind,
        x=length / 2 - behind,
        half_width=half_width,
        normal=normal,
        bottom=np.maximum(style.clearance_m + ends, style.clearance_m + arch),
        belt=_at(style.belt, share, spec),
        crest=_at(style.crest, share, spec),
        bow=bow * flank / 0.8,
        in_arch=arch > 0,
    )


def _at(line: Line, share: np.ndarray, spec: ModelSpec) -> np.ndarray:
    knots, values = np.array(line).T
    return spec.height_m * _monotone_cubic(knots, values, share)


def _axles(spec: ModelSpec, length: float) -> list[float]:
    return [length / 2 - spec.front_axle_x_m, length / 2 - spec.rear_axle_x_m]


def _sections(spec: ModelSpec, style: BodyStyle, length: float) -> np.ndarray:
    edges = [*style.windscreen, *style.backlight, *(edge for pane in style.panes for edge in pane)]
    edges += [np.mean(style.windscreen), np.mean(style.backlight)]
    radius = style.wheel_radius_m(spec) + ARCH_GAP_M
    return sections(length, style.nose, style.tail, _axles(spec, length), radius, np.array(edges) * length, spread=8)


def _monotone_cubic(knots: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Cubic through control points that never overshoots them; constant beyond its ends.

    The slopes are those of Fritsch and Carlson, "Monotone piecewise cubic interpolation", 1980, in the
    harmonic-mean form of Fritsch and Butland.

    Args:
        knots: (k,) increasing.
        values: (k,).
        at: any shape.
    """
    knots, values = np.asarray(knots, np.float64), np.asarray(values, np.float64)
    at = np.clip(np.asarray(at, np.float64), knots[0], knots[-1])
    step = np.diff(knots)
    secant = np.diff(values) / step
    before, after = secant[:-1], secant[1:]
    w1, w2 = 2 * step[1:] + step[:-1], step[1:] + 2 * step[:-1]
    rising = before * after > 0
    inner = np.zeros_like(before)
    inner[rising] = (w1 + w2)[rising] / (w1[rising] / before[rising] + w2[rising] / after[rising])
    slope = np.concatenate([secant[:1], inner, secant[-1:]])
    i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(step) - 1)
    h, t = step[i], (at - knots[i]) / step[i]
    return (
        values[i] * (1 + 2 * t) * (1 - t) ** 2
        + slope[i] * h * t * (1 - t) ** 2
        + values[i + 1] * t**2 * (3 - 2 * t)
        + slope[i + 1] * h * t**2 * (t - 1)
    )


def _smooth_step(low: float, high: float, at: np.ndarray) -> np.ndarray:
    """0 below `low`, 1 above `high`, a cubic between."""
    t = np.clip((np.asarray(at, np.float64) - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)
