"""Intersection areas of many pairs of rotated rectangles: Sutherland–Hodgman clipping, vectorised."""

from __future__ import annotations

import numpy as np

_CHUNK = 100_000  # pairs clipped at a time, to bound memory


def rectangle_corners(rectangles: np.ndarray) -> np.ndarray:
    """Corners of rectangles, counter-clockwise.

    Args:
        rectangles: (n, 5) centre x, y, length along the heading, width [m], heading [rad] counter-clockwise from +x.

    Returns:
        (n, 4, 2) float64.
    """
    x, y, length, width, yaw = np.asarray(rectangles, np.float64).T
    along = np.array([1, -1, -1, 1]) * length[:, None] / 2
    across = np.array([1, 1, -1, -1]) * width[:, None] / 2
    cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    return np.stack([cos * along - sin * across + x[:, None], sin * along + cos * across + y[:, None]], -1)


def paired_intersections(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Areas that the i-th of the first and the i-th of the second rectangles share.

    Args:
        first: (n, 5) as in `rectangle_corners`.
        second: (n, 5).

    Returns:
        (n,) float64 [m²]; 0 where a rectangle has no area.
    """
    first, second = (np.asarray(a, np.float64).reshape(-1, 5) for a in (first, second))
    areas = np.zeros(len(first))
    has_area = (first[:, 2:4] > 0).all(1) & (second[:, 2:4] > 0).all(1)
    reach = (np.hypot(first[:, 2], first[:, 3]) + np.hypot(second[:, 2], second[:, 3])) / 2
    is_near = np.hypot(*(first[:, :2] - second[:, :2]).T) < reach
    rows = np.flatnonzero(has_area & is_near)
    for start in range(0, len(rows), _CHUNK):
        chunk = rows[start : start + _CHUNK]
        middle = first[chunk, :2]  # clip near the origin, where floats are dense
        a, b = first[chunk].copy(), second[chunk].copy()
        a[:, :2] -= middle
        b[:, :2] -= middle
        areas[chunk] = _area(_clip_all(rectangle_corners(a), rectangle_corners(b)))
    return areas


def paired_iou(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Intersection over union of paired rectangles (n, 5), (n,) float64 in 0–1."""
    first, second = (np.asarray(a, np.float64).reshape(-1, 5) for a in (first, second))
    shared = paired_intersections(first, second)
    union = first[:, 2] * first[:, 3] + second[:, 2] * second[:, 3] - shared
    return np.divide(shared, union, out=np.zeros_like(shared), where=(shared > 0) & (union > 0))


def _clip_all(polygons: np.ndarray, windows: np.ndarray) -> np.ndarray:
    for side in range(4):
        polygons = _clip(polygons, windows[:, side], windows[:, (side + 1) % 4])
    return polygons


def _clip(polygons: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Convex polygons (n, v, 2) cut to the left of lines, as (n, v + 1, 2); spare vertices repeat the last one."""
    direction = (end - start)[:, None]
    offset = polygons - start[:, None]
    side = direction[..., 0] * offset[..., 1] - direction[..., 1] * offset[..., 0]
    next_vertices, side_after = np.roll(polygons, -1, 1), np.roll(side, -1, 1)
    inside, crossing = side >= 0, (side >= 0) != (side_after >= 0)
    share = np.divide(side, side - side_after, out=np.zeros_like(side), where=crossing)
    cut = polygons + share[..., None] * (next_vertices - polygons)
    count, vertices = inside.shape
    candidates = np.stack([polygons, cut], 2).reshape(count, 2 * vertices, 2)
    kept = np.stack([inside, crossing], 2).reshape(count, 2 * vertices)
    order = np.argsort(~kept, axis=1, kind="stable")[:, : vertices + 1]
    last = np.clip(kept.sum(1), 1, vertices + 1)[:, None] - 1
    order = np.where(np.arange(vertices + 1) > last, np.take_along_axis(order, last, 1), order)
    result = np.take_along_axis(candidates, order[..., None], 1)
    result[~kept.any(1)] = 0.0
    return result


def _area(polygons: np.ndarray) -> np.ndarray:
    next_vertices = np.roll(polygons, -1, 1)
    doubled = polygons[..., 0] * next_vertices[..., 1] - polygons[..., 1] * next_vertices[..., 0]
    return np.clip(doubled.sum(1) / 2, 0, None)
