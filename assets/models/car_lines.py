"""Lengthwise lines of a car body, sampled at its cross-sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.models.catalogue import ModelSpec
from assets.models.curves import monotone_cubic, smooth_step
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
    ends = 0.03 * (1 - smooth_step(0.1, 0.45, behind)) + 0.05 * smooth_step(length - 0.4, length, behind)
    share = behind / length
    glass_end = style.backlight[0]
    bow = (
        0.16 * smooth_step(0.05, style.windscreen[0], share)
        - 0.10 * smooth_step(style.windscreen[0], style.windscreen[1] + 0.05, share)
        - 0.10 * smooth_step(style.windscreen[1] + 0.05, glass_end, share)
        + 0.04 * smooth_step(glass_end, 1.0, share)
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
    return spec.height_m * monotone_cubic(knots, values, share)


def _axles(spec: ModelSpec, length: float) -> list[float]:
    return [length / 2 - spec.front_axle_x_m, length / 2 - spec.rear_axle_x_m]


def _sections(spec: ModelSpec, style: BodyStyle, length: float) -> np.ndarray:
    edges = [*style.windscreen, *style.backlight, *(edge for pane in style.panes for edge in pane)]
    edges += [np.mean(style.windscreen), np.mean(style.backlight)]
    radius = style.wheel_radius_m(spec) + ARCH_GAP_M
    return sections(length, style.nose, style.tail, _axles(spec, length), radius, np.array(edges) * length, spread=8)
