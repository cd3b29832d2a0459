"""Unit vectors of headings."""

from __future__ import annotations

import numpy as np


def unit_vectors(heading_rad: np.ndarray) -> np.ndarray:
    """Directions (…, 2), x east and y north, of headings (…), counter-clockwise from east [rad]."""
    vectors = np.empty((*heading_rad.shape, 2))
    np.cos(heading_rad, out=vectors[..., 0])
    np.sin(heading_rad, out=vectors[..., 1])
    return vectors
