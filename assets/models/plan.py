"""Plan outlines, wheel arches and the places where cross-sections are taken."""

from __future__ import annotations

import numpy as np

ARCH_GAP_M = 0.05
_MERGE_M = 0.06
Rounding = tuple[float, float]  # depth (m) and exponent of a superellipse


def superellipse_depth(share: np.ndarray, depth: float, exponent: float) -> np.ndarray:
    """Distance behind the end at which a rounded outline has grown to `share` of its half-width."""
    return depth * (1 - (1 - np.asarray(share) ** exponent) ** (1 / exponent))


def sections(
    length: float,
    nose: Rounding,
    tail: Rounding,
    axles: list[float],
    arch_radius: float,
    edges: np.ndarray,
    spread: int,
    fractions: tuple[float, ...] = (0.0, 0.30, 0.57, 0.80, 0.94),
) -> np.ndarray:
    """Sorted distances behind the nose at which a body is cut, near ones merged.

    Args:
        length: of the body, metres.
        nose: rounding of the front in plan.
        tail: rounding of the rear in plan.
        axles: distances of the axles behind the nose.
        arch_radius: half the length of a wheel arch.
        edges: distances that must be hit within a centimetre: the edges of glass.
        spread: number of evenly spaced sections away from other ones.
        fractions: shares of the half-width at which the rounded ends are cut.
    """
    shares = np.array(fractions)
    turn = np.linspace(0, np.pi, 9)
    arches = [axle - arch_radius * np.cos(turn) for axle in axles]
    arch_ends = np.concatenate([arch[[0, -1]] for arch in arches])
    ends = np.concatenate([superellipse_depth(shares, *nose), length - superellipse_depth(shares, *tail)])
    tips = (ends == 0) | (ends == length)
    must = np.concatenate([arch_ends, ends[tips | _apart(ends, arch_ends, 0.5 * _MERGE_M)]])
    edges = np.unique(np.round(edges, 4))
    edges = edges[np.diff(edges, prepend=-1.0) > 0.012]
    places = np.concatenate([must, edges[_apart(edges, must, 0.012)]])
    for wish in (np.concatenate([arch[1:-1] for arch in arches]), np.linspace(0, length, spread + 2)[1:-1]):
        places = np.concatenate([places, wish[_apart(wish, places, _MERGE_M)]])
    return np.sort(places)


def _apart(candidates: np.ndarray, others: np.ndarray, gap_m: float) -> np.ndarray:
    return np.abs(candidates[:, None] - others).min(1) > gap_m


def plan_outline(
    behind: np.ndarray, length: float, flank: float, nose: Rounding, tail: Rounding
) -> tuple[np.ndarray, np.ndarray]:
    """Half-width (c,) and outward normal (c, 2) of a plan outline of half-width `flank`."""
    width = np.full(len(behind), flank)
    normal = np.tile([0.0, 1.0], (len(behind), 1))
    for sign, distance, (depth, n) in ((1.0, behind, nose), (-1.0, length - behind, tail)):
        rest = np.clip(1 - distance / depth, 0.0, 1.0)
        share = np.maximum(1 - rest**n, 0.0) ** (1 / n)
        inside = rest > 0
        width = np.where(inside, flank * share, width)
        outward = np.stack([sign * rest ** (n - 1) / depth, share ** (n - 1) / flank], 1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        normal = np.where(inside[:, None], outward, normal)
    return width, normal


def arch_rise(behind: np.ndarray, axle: float, radius: float, rise: float) -> np.ndarray:
    """Rise (c,) of a wheel arch above the underbody: half a superellipse about the axle."""
    share = np.clip(np.abs(behind - axle) / radius, 0, 1)
    share = np.where(share > 1 - 1e-6, 1.0, share)
    return rise * (1 - share**2.3) ** (1 / 2.3)
