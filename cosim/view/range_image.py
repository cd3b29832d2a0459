"""The scan as its sensor took it: a row a ring, a column an azimuth, the front in the middle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.view.colours import BACKGROUND, MUTED, Scale
from cosim.view.drawing import draw_colour_bar, draw_path, draw_text

MARGIN_PX = 30
_FOOTER_PX = 100


@dataclass(frozen=True)
class RangeGrid:
    """How beams are laid out.

    Attributes:
        rings: rows; ring 0, the top laser, on top.
        columns: azimuth steps of a turn, from +180° (behind, by the left) over 0° in the middle to −180°.
    """

    rings: int = 64
    columns: int = 2083

    def column(self, azimuth: np.ndarray) -> np.ndarray:
        """Column (n,) int64 of azimuths [rad]; that of 0 is columns // 2."""
        share = (np.pi - np.asarray(azimuth, np.float64)) / (2 * np.pi)
        return np.floor(share * self.columns + 1e-6).astype(np.int64) % self.columns


def nearest_points(ring: np.ndarray, azimuth: np.ndarray, range_m: np.ndarray, grid: RangeGrid) -> np.ndarray:
    """The nearest point of every cell.

    Args:
        ring: (n,) integers.
        azimuth: (n,) [rad].
        range_m: (n,) [m].
        grid: layout; rings beyond it are left out.

    Returns:
        (rings, columns) int64 row of the point, −1 where none came back.
    """
    cells = np.full((grid.rings, grid.columns), -1, np.int64)
    far_first = np.argsort(-range_m, kind="stable")
    far_first = far_first[ring[far_first] < grid.rings]
    cells[ring[far_first].astype(int), grid.column(azimuth[far_first])] = far_first
    return cells


def draw_range_image(cells: np.ndarray, values: np.ndarray, scale: Scale, stretch: int = 6) -> np.ndarray:
    """A picture of one value per beam, black where nothing came back, with azimuths and a colour bar below.

    Args:
        cells: as `nearest_points` gives them.
        values: (n,) of all points.
        scale: colours of the values.
        stretch: rows of pixels a ring.

    Returns:
        (h, w, 3) uint8 RGB.
    """
    rings, columns = cells.shape
    picture = np.zeros((rings, columns, 3), np.uint8)
    there = cells >= 0
    picture[there] = scale.colours(values[cells[there]])
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
