"""Range image of a scan: one row per ring, one column per azimuth step, the forward direction in the middle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.view.colours import BACKGROUND, MUTED, Scale
from cosim.view.drawing import draw_colour_bar, draw_path, draw_text

MARGIN_PX = 30
_FOOTER_PX = 100


@dataclass(frozen=True)
class RangeGrid:
    """Grid of a range image.

    Attributes:
        rings: number of rows; ring 0, the top laser, is on top.
        columns: azimuth steps per revolution, from +180° (backward) over +90° (left) and 0° (forward) to −180°.
    """

    rings: int = 64
    columns: int = 2083

    def column(self, azimuth: np.ndarray) -> np.ndarray:
        """Column (n,) int64 of azimuths [rad]; that of 0 is columns // 2."""
        share = (np.pi - np.asarray(azimuth, np.float64)) / (2 * np.pi)
        return np.floor(share * self.columns + 1e-6).astype(np.int64) % self.columns


def nearest_points(ring: np.ndarray, azimuth: np.ndarray, range_m: np.ndarray, grid: RangeGrid) -> np.ndarray:
    """Find the nearest point of every cell.

    Args:
        ring: (n,) ring numbers, integers.
        azimuth: (n,) azimuths [rad].
        range_m: (n,) ranges [m].
        grid: grid of the image; rings outside it are skipped.

    Returns:
        (rings, columns) int64 index of the point, −1 without a return.
    """
    cells = np.full((grid.rings, grid.columns), -1, np.int64)
    far_first = np.argsort(-range_m, kind="stable")
    far_first = far_first[ring[far_first] < grid.rings]
    cells[ring[far_first].astype(int), grid.column(azimuth[far_first])] = far_first
    return cells


def draw_range_image(cells: np.ndarray, values: np.ndarray, scale: Scale, stretch: int = 6) -> np.ndarray:
    """Draw one value per beam (black without a return), with an azimuth axis and a colour bar.

    Args:
        cells: result of `nearest_points`.
        values: (n,) values of all points.
        scale: colour scale of the values.
        stretch: pixel rows per ring.

    Returns:
        (h, w, 3) uint8 RGB.
    """
    rings, columns = cells.shape
    picture = np.zeros((rings, columns, 3), np.uint8)
    has_point = cells >= 0
    picture[has_point] = scale.colours(values[cells[has_point]])
    height = rings * stretch
    image = np.full((height + _FOOTER_PX + MARGIN_PX, columns + 2 * MARGIN_PX, 3), BACKGROUND, np.uint8)
    image[MARGIN_PX : MARGIN_PX + height, MARGIN_PX:-MARGIN_PX] = np.repeat(picture, stretch, axis=0)
    for degrees in range(-180, 181, 45):
        x = MARGIN_PX + (180 - degrees) / 360 * columns
        bottom = MARGIN_PX + height
        draw_path(image, np.array([[x, bottom], [x, bottom + 6]]), MUTED)
        side = {0: " front", 90: " left", -90: " right"}.get(degrees, "")
        draw_text(
            image,
            f"{degrees:+d} deg{side}" if degrees else f"0 deg{side}",
            (x, bottom + 12),
            12,
            MUTED,
            (min(1, max(0, (180 - degrees) / 360)), 0),
        )
    draw_text(image, f"rows: ring 0 on top to ring {rings - 1}", (MARGIN_PX, 8), 13, MUTED)
    width = min(600, columns)
    draw_colour_bar(image, scale, (MARGIN_PX + columns - width, height + MARGIN_PX + 58), (width, 15))
    return image
