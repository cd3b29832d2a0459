"""Draw close-ups of the objects with the most points."""

from __future__ import annotations

import numpy as np

from cosim.view.colours import BACKGROUND, TEXT
from cosim.view.drawing import draw_text
from cosim.view.objects import Objects
from cosim.view.perspective import close_view, draw_perspective

FEWEST_POINTS = 60
_MOST = 4
_GAP_PX = 6
_WIDTH_PX = 1606
_HEIGHT_PX = 540


def best_seen(counts: np.ndarray) -> np.ndarray:
    """Rows of up to four objects with the most points, at least `FEWEST_POINTS`."""
    order = np.argsort(-counts, kind="stable")[:_MOST]
    return order[counts[order] >= FEWEST_POINTS]


def draw_close_ups(points: np.ndarray, colours: np.ndarray, objects: Objects, counts: np.ndarray) -> np.ndarray:
    """Draw the objects selected by `best_seen` (at least one) in rows of two; an odd last one has the full width.

    Args:
        points: (n, ≥ 3) in LiDAR axes [m].
        colours: (n, 3) uint8 RGB.
        objects: of the frame.
        counts: points of each object.
    """
    chosen = best_seen(counts)
    strips = []
    for pair in (chosen[i : i + 2] for i in range(0, len(chosen), 2)):
        width = (_WIDTH_PX - _GAP_PX * (len(pair) - 1)) // len(pair)
        tiles = [_draw_tile(points, colours, objects, row, int(counts[row]), width) for row in pair]
        strips.append(_joined(tiles, axis=1))
    return _joined(strips, axis=0)


def _draw_tile(
    points: np.ndarray, colours: np.ndarray, objects: Objects, row: int, count: int, width: int
) -> np.ndarray:
    tile = draw_perspective(points, colours, close_view(objects.boxes, row, width, _HEIGHT_PX))
    distance = np.linalg.norm(objects.boxes.centre[row])
    text = f"{objects.kinds[row]}, {distance:.0f} m away, {count} points"
    draw_text(tile, text, (18, 18), 14, TEXT, plate=BACKGROUND)
    return tile


def _joined(images: list[np.ndarray], axis: int) -> np.ndarray:
    """Images side by side (axis 1) or stacked (axis 0) with a gap between them."""
    shape = list(images[0].shape)
    shape[axis] = _GAP_PX
    gap = np.full(shape, BACKGROUND, np.uint8)
    parts = [part for image in images for part in (gap, image)][1:]
    return np.concatenate(parts, axis=axis)
