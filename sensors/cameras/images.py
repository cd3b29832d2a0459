"""What one camera pass yields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Images:
    """Pixel-aligned images of one camera at one instant.

    Attributes:
        rgb: (h, w, 3) uint8, square root of linear light × 255: close to sRGB, and cheap to invert.
        gray: (h, w) uint8, luma of `rgb`.
        depth_m: (h, w) float32 depth along the optical axis at the pixel's centre, 0 where nothing is hit.
        instance: (h, w) uint16, 0 for the static world and the sky, k + 1 for the k-th instance given.
        material: (h, w) uint8, 0 for the sky, k + 1 for row k of the material table.
    """

    rgb: np.ndarray
    gray: np.ndarray
    depth_m: np.ndarray
    instance: np.ndarray
    material: np.ndarray
