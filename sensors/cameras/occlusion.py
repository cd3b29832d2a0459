"""Occlusion culling: objects behind the surfaces drawn so far are left out, by a coarse depth buffer."""

from __future__ import annotations

import cv2
import numpy as np

_BLOCK_PX = 8
_SAFETY = 1.0 + 1e-4  # float rounding of the depth buffer
_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])


def box_corners(bounds: np.ndarray) -> np.ndarray:
    """Corners (n, 8, 3) of axis-aligned boxes (n, 2, 3)."""
    return np.take_along_axis(bounds, np.broadcast_to(_CORNERS, (len(bounds), 8, 3)), 1)


class Horizon:
    """The farthest surface in each block of pixels: a box wholly behind its blocks cannot be seen.

    Args:
        inverse_depth: (h, w) float32 depth buffer, near_m / depth, 0 where nothing is drawn yet.
        clip_from_world: (4, 4) float64 it was drawn with.
        near_m: near plane [m].
    """

    def __init__(self, inverse_depth: np.ndarray, clip_from_world: np.ndarray, near_m: float) -> None:
        self._height, self._width = inverse_depth.shape
        block = np.ones((_BLOCK_PX, _BLOCK_PX), np.uint8)
        # an erosion is a running minimum; past the border it meets nothing
        self._farthest = cv2.erode(inverse_depth, block, anchor=(0, 0))[::_BLOCK_PX, ::_BLOCK_PX]
        self._clip = clip_from_world
        self._near_m = near_m

    def hides(self, corners: np.ndarray) -> np.ndarray:
        """True where the hull of the corners (n, 8, 3), world axes, is behind what is drawn, (n,) bool."""
        x, y, _, depth = np.moveaxis(corners @ self._clip[:, :3].T + self._clip[:, 3], 2, 0)
        ahead = depth.min(1) > self._near_m
        depth = np.maximum(depth, self._near_m)
        columns = _block_range(x / depth, self._width)
        rows = _block_range(y / depth, self._height)
        nearest = self._near_m / depth.min(1) * _SAFETY
        hidden = np.zeros(len(corners), bool)
        for k in np.flatnonzero(ahead):
            window = self._farthest[slice(*rows[k]), slice(*columns[k])]
            hidden[k] = bool((window > nearest[k]).all())
        return hidden


def _block_range(ndc: np.ndarray, size_px: int) -> np.ndarray:
    """First and one past the last block (n, 2) that coordinates (n, 8) from −1 to 1 span."""
    pixels = np.clip((np.stack([ndc.min(1), ndc.max(1)], 1) + 1.0) / 2 * size_px, 0, size_px)
    blocks = np.floor(pixels / _BLOCK_PX).astype(np.int64)
    blocks[:, 1] += 1
    return blocks
