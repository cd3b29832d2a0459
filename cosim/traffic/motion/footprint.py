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
    x, y, sorted_reach = centre[order, 0], centre[order, 1], reach[order]
    last = np.searchsorted(x, x + sorted_reach + (reach.max() if len(reach) else 0) + margin_m, side="right")
    counts = last - np.arange(len(x)) - 1
    left = np.repeat(np.arange(len(x)), counts)
    right = left + 1 + np.arange(len(left)) - np.repeat(np.cumsum(counts) - counts, counts)
    within = sorted_reach[left] + sorted_reach[right] + margin_m
    near = (x[left] - x[right]) ** 2 + (y[left] - y[right]) ** 2 < within**2
    first, second = order[left[near]], order[right[near]]
    return np.minimum(first, second), np.maximum(first, second)


def separation(
    centre: np.ndarray, heading_rad: np.ndarray, half: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Depth of overlap of pairs (m,): positive where they overlap, minus a lower bound of their distance elsewhere."""
    return separation_of(
        (centre[first], heading_rad[first], half[first]), (centre[second], heading_rad[second], half[second])
    )


def separation_of(
    ones: tuple[np.ndarray, np.ndarray, np.ndarray], others: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> np.ndarray:
    """Separation of m pairs of boxes, each as centres (m, 2), headings (m,) and half lengths and widths (m, 2)."""
    (centre, heading_rad, half_1), (centre_2, heading_2, half_2) = ones, others
    cos_1, sin_1, cos_2, sin_2 = np.cos(heading_rad), np.sin(heading_rad), np.cos(heading_2), np.sin(heading_2)
    x, y = centre_2[:, 0] - centre[:, 0], centre_2[:, 1] - centre[:, 1]
    c, s = np.abs(cos_1 * cos_2 + sin_1 * sin_2), np.abs(sin_1 * cos_2 - cos_1 * sin_2)
    (long_1, wide_1), (long_2, wide_2) = half_1.T, half_2.T
    depth = np.minimum(
        long_1 + long_2 * c + wide_2 * s - np.abs(x * cos_1 + y * sin_1),
        wide_1 + long_2 * s + wide_2 * c - np.abs(y * cos_1 - x * sin_1),
    )
    depth = np.minimum(depth, long_2 + long_1 * c + wide_1 * s - np.abs(x * cos_2 + y * sin_2))
    return np.minimum(depth, wide_2 + long_1 * s + wide_1 * c - np.abs(y * cos_2 - x * sin_2))
