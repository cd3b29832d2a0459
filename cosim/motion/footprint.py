"""Boxes seen from above, and which of them overlap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Overlap:
    """Pairs of boxes that overlap.

    Attributes:
        first, second: (m,) rows, first < second.
        depth_m: (m,) how far they would have to be moved apart.
    """

    first: np.ndarray
    second: np.ndarray
    depth_m: np.ndarray


def overlaps(
    centre: np.ndarray, heading_rad: np.ndarray, size: np.ndarray, pairs: tuple[np.ndarray, np.ndarray] | None = None
) -> Overlap:
    """Pairs of boxes that overlap, by the separating-axis theorem (Gottschalk et al. 1996, in two dimensions).

    Args:
        centre: (n, 2) middles of the boxes, world metres.
        heading_rad: (n,).
        size: (n, 2 or more) length and width [m].
        pairs: two (m,) arrays of rows to test; all pairs near each other by default.
    """
    half = size[:, :2] / 2
    first, second = near_pairs(centre, np.linalg.norm(half, axis=1)) if pairs is None else pairs
    depth = separation(centre, heading_rad, half, first, second)
    hit = depth > 0
    return Overlap(first[hit], second[hit], depth[hit])


def near_pairs(centre: np.ndarray, reach: np.ndarray, margin_m: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Rows of pairs whose circles of radius `reach` (n,) come within `margin_m` of each other."""
    order = np.argsort(centre[:, 0], kind="stable")
    x = centre[order, 0]
    last = np.searchsorted(x, x + reach[order] + (reach.max() if len(reach) else 0) + margin_m, side="right")
    counts = last - np.arange(len(x)) - 1
    left = np.repeat(np.arange(len(x)), counts)
    right = left + 1 + np.arange(len(left)) - np.repeat(np.cumsum(counts) - counts, counts)
    first, second = order[left], order[right]
    apart = centre[first] - centre[second]
    near = np.einsum("ij,ij->i", apart, apart) < (reach[first] + reach[second] + margin_m) ** 2
    first, second = first[near], second[near]
    return np.minimum(first, second), np.maximum(first, second)


def separation(
    centre: np.ndarray, heading_rad: np.ndarray, half: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Depth of overlap of pairs (m,): positive where they overlap, minus a lower bound of their distance elsewhere."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    apart = centre[second] - centre[first]
    c = np.abs(cos[first] * cos[second] + sin[first] * sin[second])
    s = np.abs(sin[first] * cos[second] - cos[first] * sin[second])
    depth = np.full(len(first), np.inf)
    for own, other in ((first, second), (second, first)):
        along = np.abs(apart[:, 0] * cos[own] + apart[:, 1] * sin[own])
        across = np.abs(apart[:, 1] * cos[own] - apart[:, 0] * sin[own])
        reach_along = half[own, 0] + half[other, 0] * c + half[other, 1] * s
        reach_across = half[own, 1] + half[other, 0] * s + half[other, 1] * c
        depth = np.minimum(depth, np.minimum(reach_along - along, reach_across - across))
    return depth
