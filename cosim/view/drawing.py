"""Draw anti-aliased text, lines and colour bars on RGB images, and place labels without overlap."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from cosim.view.colours import BACKGROUND, MUTED, TEXT, Rgb, Scale

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_HERSHEY_PX = 21.0  # height of its capitals at scale 1
_FRACTION_BITS = 4
_FARTHEST_PX = 1e5  # keeps OpenCV's fixed-point coordinates from overflowing

Rect = tuple[float, float, float, float]


def text_size(text: str, height_px: float) -> tuple[int, int]:
    """Width and height in pixels of a line of text whose capitals are `height_px` high."""
    (width, height), _ = cv2.getTextSize(text, _FONT, height_px / _HERSHEY_PX, _stroke(height_px))
    return width, height


def draw_text(
    image: np.ndarray,
    text: str,
    at: tuple[float, float],
    height_px: float = 11,
    colour: Rgb = TEXT,
    anchor: tuple[float, float] = (0.0, 0.0),
    plate: Rgb | None = None,
) -> None:
    """Write one line.

    Args:
        image: (h, w, 3) uint8, drawn on.
        text: ASCII; the font has nothing else.
        at: (x, y) pixel of the anchor.
        height_px: height of the capitals.
        colour: of the letters.
        anchor: which point of the text lies there: (0, 0) top left, (0.5, 0.5) the middle.
        plate: colour of a plate behind the letters, if any.
    """
    width, height = text_size(text, height_px)
    left, top = round(at[0] - anchor[0] * width), round(at[1] - anchor[1] * height)
    if plate is not None:
        pad = max(2, round(height_px * 0.4))
        cv2.rectangle(image, (left - pad, top - pad), (left + width + pad, top + height + pad), plate, -1)
    scale, stroke = height_px / _HERSHEY_PX, _stroke(height_px)
    cv2.putText(image, text, (left, top + height), _FONT, scale, colour, stroke, cv2.LINE_AA)


def draw_segments(image: np.ndarray, segments: np.ndarray, colour: Rgb, thickness: int = 1) -> None:
    """Draw lines (n, 2, 2): start and end as (x, y) pixels."""
    for start, end in segments:
        draw_path(image, np.stack([start, end]), colour, thickness)


def draw_path(image: np.ndarray, points: np.ndarray, colour: Rgb, thickness: int = 1, *, closed: bool = False) -> None:
    """Draw a line through points (n, 2) in pixels, to a sixteenth of one."""
    bounded = np.clip(points, -_FARTHEST_PX, _FARTHEST_PX)
    fixed = np.rint(bounded * (1 << _FRACTION_BITS)).astype(np.int32)
    cv2.polylines(image, [fixed], closed, colour, thickness, cv2.LINE_AA, _FRACTION_BITS)


def fill_polygon(image: np.ndarray, points: np.ndarray, colour: Rgb) -> None:
    """Fill a polygon (n, 2) in pixels."""
    fixed = np.rint(points * (1 << _FRACTION_BITS)).astype(np.int32)
    cv2.fillPoly(image, [fixed], colour, cv2.LINE_AA, _FRACTION_BITS)


class LabelPlacer:
    """Places labels so that they do not overlap, if possible."""

    def __init__(self, image: np.ndarray, height_px: float) -> None:
        self._image = image
        self._height_px = height_px
        self._taken: list[Rect] = []

    def place(self, text: str, candidates: Sequence[tuple[float, float]], plate: Rgb) -> None:
        """Write `text` in dark letters on a coloured background, centred at the first free candidate (x, y)."""
        width, height = text_size(text, self._height_px)
        pad = max(2, round(self._height_px * 0.4))
        half_width, half_height = width / 2 + pad, height / 2 + pad
        rows, columns = self._image.shape[:2]
        fallback: tuple[float, float] | None = None
        for x, y in candidates:
            x = float(np.clip(x, half_width, columns - 1 - half_width))
            y = float(np.clip(y, half_height, rows - 1 - half_height))
            rect = (x - half_width, y - half_height, x + half_width, y + half_height)
            fallback = fallback or (x, y)
            if not any(_overlap(rect, other) for other in self._taken):
                break
        else:
            if fallback is None:
                return
            x, y = fallback
            rect = (x - half_width, y - half_height, x + half_width, y + half_height)
        self._taken.append(rect)
        draw_text(self._image, text, (x, y), self._height_px, BACKGROUND, (0.5, 0.5), plate)


def above(x: float, y: float, step_px: float) -> list[tuple[float, float]]:
    """Candidate positions for a label at (x, y): there, at increasing heights above it, then to its right and left."""
    higher = [(x, y - step * step_px) for step in range(7)]
    beside = [(x + side * 4 * step_px, y + down * step_px) for side in (1, -1, 2, -2) for down in (0, 1, 2)]
    return higher + beside


def draw_colour_bar(image: np.ndarray, scale: Scale, at: tuple[int, int], size: tuple[int, int]) -> None:
    """Draw a colour bar with ticks and its name above.

    Args:
        image: (h, w, 3) uint8, drawn on.
        scale: of the colours.
        at: (x, y) of the bar's top left corner.
        size: width and height of the bar in pixels.
    """
    (x, y), (width, height) = at, size
    values = np.array([scale.value(share) for share in np.linspace(0, 1, width)])
    draw_text(image, scale.name, (x, y - height * 0.55), height * 0.75, TEXT, (0, 1))
    image[y : y + height, x : x + width] = scale.colours(values)[None]
    for tick in scale.ticks:
        share = float(scale.share(np.array(tick)))
        draw_text(image, f"{tick:.2g}", (x + share * width, y + height * 1.5), height * 0.7, MUTED, (share, 0))


def _overlap(a: Rect, b: Rect) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _stroke(height_px: float) -> int:
    return max(1, round(height_px / 9))
