"""A town's ground as a shaded picture."""

from __future__ import annotations

import base64

import cv2
import numpy as np
from scipy.interpolate import RBFInterpolator

from assets.streets import Streets

_CELLS = 72
_MOST_SAMPLES = 1500
_LOW_RGB, _HIGH_RGB = np.array([196, 218, 190]), np.array([238, 222, 188])
_STEEP = 12.0  # exaggerates slopes for the shade


def relief_picture(streets: Streets, low: np.ndarray, high: np.ndarray) -> str:
    """Return a `data:` URL of a PNG over the rectangle from `low` to `high` (2,), north up, lit from the north-west."""
    height = heights(streets, low, high)
    cell = (high - low) / (_CELLS - 1)
    east, north = np.gradient(height, cell[0], cell[1])
    shade = np.clip(1.0 + _STEEP * (east - north) / np.sqrt(2) * 0.5, 0.72, 1.12)[..., None]
    share = ((height - height.min()) / max(np.ptp(height), 8.0))[..., None]
    rgb = np.clip((_LOW_RGB + share * (_HIGH_RGB - _LOW_RGB)) * shade, 0, 255).astype(np.uint8)
    picture = np.ascontiguousarray(rgb.transpose(1, 0, 2)[::-1, :, ::-1])
    _, data = cv2.imencode(".png", picture)
    return f"data:image/png;base64,{base64.b64encode(data.tobytes()).decode()}"


def heights(streets: Streets, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the ground's height in metres on a grid over a rectangle, first axis east, second north."""
    points = np.concatenate([lane.centre for lane in streets.lanes])
    points = points[:: max(1, len(points) // _MOST_SAMPLES)]
    surface = RBFInterpolator(points[:, :2], points[:, 2], neighbors=48, smoothing=1.0, kernel="linear")
    x, y = (np.linspace(low[k], high[k], _CELLS) for k in (0, 1))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return surface(grid).reshape(_CELLS, _CELLS)
