"""Reflectances of surfaces that are known only from the scans themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from assets.materials import MaterialTable


@dataclass(frozen=True, eq=False)
class FrameReflectances:
    """Reflectances of one frame's objects, and how far intensities scatter beyond what the sensor predicts.

    Attributes:
        paint: (m,) float32 reflectance of the paint of each instance, 0–1.
        ground_intensity_sd: standard deviation of the ground's intensity due to its unknown texture.
        body_intensity_sd: (m,) float32, the same for each instance.
    """

    paint: np.ndarray
    ground_intensity_sd: float
    body_intensity_sd: np.ndarray


@dataclass(frozen=True, eq=False)
class Reflectances:
    """Reflectances of a drive whose twin was made from labels and scans.

    Attributes:
        table: materials of the static world.
        by_frame: reflectances of each frame's objects.
    """

    table: MaterialTable
    by_frame: Mapping[str, FrameReflectances]
