"""The 2D box of a 3D box: what of it lies before the camera, projected, and cut to the image."""

from __future__ import annotations

import numpy as np

NEAR_M = 0.1
_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])


def project_corners(corners_rect: np.ndarray, projection: np.ndarray) -> np.ndarray:
    """2D boxes around projected 3D boxes, not cut to the image.

    Edges are cut at 0.1 m before the camera, so that a box next to it that extends behind it is projected correctly.

    Args:
        corners_rect: (n, 8, 3) in rectified camera axes [m], bottom four round the box, then top four.
        projection: (3, 4) of the camera.

    Returns:
        (n, 4) float64 left, top, right, bottom [px]; NaN for a box wholly behind the camera.
    """
    corners = corners_rect @ projection[:, :3].T + projection[:, 3]
    start, end = corners[:, _EDGES[:, 0]], corners[:, _EDGES[:, 1]]
    start, end = _cut(start, end), _cut(end, start)
    ends = np.concatenate([start, end], 1)
    before = ends[..., 2:] >= NEAR_M * (1 - 1e-9)
    uv = np.divide(ends[..., :2], ends[..., 2:], out=np.zeros_like(ends[..., :2]), where=before)
    boxes = np.concatenate([np.where(before, uv, np.inf).min(1), np.where(before, uv, -np.inf).max(1)], -1)
    boxes[~before.any((1, 2))] = np.nan
    return boxes


def clip_boxes(boxes: np.ndarray, width: int, height: int) -> np.ndarray:
    """2D boxes (n, 4) cut to the image, whose pixels span 0 … width − 1 and 0 … height − 1."""
    return np.clip(boxes, 0, [width - 1, height - 1, width - 1, height - 1])


def box_areas(boxes: np.ndarray) -> np.ndarray:
    """Areas of 2D boxes (n, 4), (n,) [px²]."""
    return np.clip(boxes[:, 2] - boxes[:, 0], 0, None) * np.clip(boxes[:, 3] - boxes[:, 1], 0, None)


def _cut(inner: np.ndarray, outer: np.ndarray) -> np.ndarray:
    """`inner` moved along the edge to `outer` until it lies before the camera, where the edge does."""
    depth, other = inner[..., 2:], outer[..., 2:]
    crossing = (depth < NEAR_M) & (other >= NEAR_M)
    share = np.divide(NEAR_M - depth, other - depth, out=np.zeros_like(depth), where=crossing)
    return inner + share * (outer - inner)
