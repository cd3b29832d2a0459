"""Lengthwise lines of a car body, sampled at its cross-sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.models.catalogue import ModelSpec
from assets.models.curves import monotone_cubic, smooth_step
from assets.models.styles import Line, Style

MIRROR_REACH_M = 0.03  # how far a mirror stands out beyond the flank
PLATE_REACH_M = 0.008  # how far a number plate stands out beyond the bumper
ARCH_GAP_M = 0.05
_NOSE_FRACTIONS = (0.0, 0.30, 0.57, 0.80, 0.94)
_MERGE_M = 0.045


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


def car_lines(spec: ModelSpec, style: Style) -> CarLines:
    """Sample the lines of `style` at sections fit for the dimensions of `spec`."""
    length = spec.length_m - 2 * PLATE_REACH_M
    flank = spec.width_m / 2 - MIRROR_REACH_M
    behind = _sections(spec, style, length)
    half_width, normal = _plan(behind, length, flank, style)
    arch = np.max([_arch(behind, axle, style, spec) for axle in _axles(spec, length)], axis=0)
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


def _axles(spec: ModelSpec, length: float) -> tuple[float, float]:
    return length / 2 - spec.front_axle_x_m, length / 2 - spec.rear_axle_x_m


def _sections(spec: ModelSpec, style: Style, length: float) -> np.ndarray:
    """Distances behind the nose: rounding of both ends, arches, and every edge of glass, near ones merged."""
    edges = [*style.windscreen, *style.backlight, *(edge for pane in style.panes for edge in pane)]
    edges += [np.mean(style.windscreen), np.mean(style.backlight)]
    fixed = np.unique(np.round(np.array(edges) * length, 4))
    ends = [_superellipse(np.array(_NOSE_FRACTIONS), *style.nose)]
    ends.append(length - _superellipse(np.array(_NOSE_FRACTIONS), *style.tail))
    radius = style.wheel_radius_m(spec) + ARCH_GAP_M
    turn = np.linspace(0, np.pi, 9)
    arches = [axle - radius * np.cos(turn) for axle in _axles(spec, length)]
    must = np.concatenate([*ends, *(arch[[0, -1]] for arch in arches)])
    wish = np.concatenate([*(arch[1:-1] for arch in arches), np.linspace(0, 1, 10)[1:-1] * length])
    sections = np.concatenate([must, fixed[_apart(fixed, must, 0.012)]])
    sections = np.concatenate([sections, wish[_apart(wish, sections, _MERGE_M)]])
    return np.sort(sections)


def _apart(candidates: np.ndarray, others: np.ndarray, gap_m: float) -> np.ndarray:
    return np.abs(candidates[:, None] - others).min(1) > gap_m


def _superellipse(share: np.ndarray, depth: float, exponent: float) -> np.ndarray:
    """Distance behind the end at which the outline has grown to `share` of its half-width."""
    return depth * (1 - (1 - share**exponent) ** (1 / exponent))


def _plan(behind: np.ndarray, length: float, flank: float, style: Style) -> tuple[np.ndarray, np.ndarray]:
    """Half-width and outward normal of the plan outline."""
    width = np.full(len(behind), flank)
    normal = np.tile([0.0, 1.0], (len(behind), 1))
    for sign, distance, (depth, n) in (
        (1.0, behind, style.nose),
        (-1.0, length - behind, style.tail),
    ):
        rest = np.clip(1 - distance / depth, 0.0, 1.0)
        share = np.maximum(1 - rest**n, 0.0) ** (1 / n)
        inside = rest > 0
        width = np.where(inside, flank * share, width)
        outward = np.stack([sign * rest ** (n - 1) / depth, share ** (n - 1) / flank], 1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        normal = np.where(inside[:, None], outward, normal)
    return width, normal


def _arch(behind: np.ndarray, axle: float, style: Style, spec: ModelSpec) -> np.ndarray:
    """Rise of a wheel arch above the underbody: half a superellipse about the axle."""
    radius = style.wheel_radius_m(spec) + ARCH_GAP_M
    rise = style.wheel_radius_m(spec) + radius - style.clearance_m
    share = np.clip(np.abs(behind - axle) / radius, 0, 1)
    share = np.where(share > 1 - 1e-6, 1.0, share)
    return rise * (1 - share**2.3) ** (1 / 2.3)
