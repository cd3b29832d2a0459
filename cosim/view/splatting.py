"""Draw points as small discs with a z-buffer, and shade them from the depth image.

Shading is eye-dome lighting (Boucheny, "Visualisation scientifique de grands volumes de données", 2009): a pixel is
darkened if its neighbours are nearer. Opposite neighbours are added, so that an inclined plane such as the road is not
darkened, only edges and creases.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.view.projection import Viewpoint

_NEIGHBOURS = ((1, 0), (0, 1), (1, 1), (1, -1))
_MAX_OCTAVES = 0.035  # larger steps of depth do not darken more
NOTHING = -1


@dataclass(frozen=True, eq=False)
class Splats:
    """Visible point of every pixel.

    Attributes:
        index: (h, w) int32 index of the point, −1 without a point.
        depth: (h, w) float32 depth [m], inf without a point.
    """

    index: np.ndarray
    depth: np.ndarray


def splat(points: np.ndarray, radius_m: np.ndarray, view: Viewpoint, *, limits_px: tuple[float, float]) -> Splats:
    """Draw points as discs that are convex towards the camera; the nearest disc is visible.

    Args:
        points: (n, ≥ 3) points in LiDAR axes [m].
        radius_m: (n,) radii of the discs [m].
        view: view of the camera.
        limits_px: minimum and maximum radius in the image [px].
    """
    uv, depth = view.project(points)
    radius_px = np.clip(view.focal_px * radius_m / np.maximum(depth, view.near_m), *limits_px)
    with np.errstate(invalid="ignore"):
        margin = limits_px[1]
        seen = np.flatnonzero(((uv > -margin) & (uv < [view.width + margin, view.height + margin])).all(1))
    nearest = np.full(view.width * view.height, np.iinfo(np.uint64).max, np.uint64)
    steps = np.rint(radius_px[seen]).astype(int)
    for step in np.unique(steps):
        rows = seen[steps == step]
        _splat_disc(nearest, rows, uv[rows], depth[rows], radius_m[rows], int(step), view)
    empty = nearest == np.iinfo(np.uint64).max
    index = np.where(empty, NOTHING, nearest & np.uint64(0xFFFFFFFF)).astype(np.int64).astype(np.int32)
    bits = (nearest >> np.uint64(32)).astype(np.uint32)
    shown = np.where(empty, np.float32(np.inf), bits.view(np.float32))
    return Splats(index.reshape(view.height, view.width), shown.reshape(view.height, view.width))


def shade(depth: np.ndarray, reach_px: int, strength: float) -> np.ndarray:
    """Brightness 0–1 of every pixel, (h, w) float32, from depth.

    Args:
        depth: (h, w) float32 depth [m], inf without a point.
        reach_px: distance of the neighbours that are compared.
        strength: 0 for no shading; the brightness is e^(−strength · mean excess of depth in octaves).
    """
    empty = ~np.isfinite(depth)
    octaves = np.log2(np.where(empty, 1, depth)).astype(np.float32)
    excess = np.zeros_like(octaves)
    for across, down in _NEIGHBOURS:
        pair = np.zeros_like(octaves)
        for sign in (1, -1):
            pair += _step_to(octaves, empty, sign * across * reach_px, sign * down * reach_px)
        excess += np.clip(pair, 0, _MAX_OCTAVES)
    return np.exp(-strength / len(_NEIGHBOURS) * excess)


def _splat_disc(
    nearest: np.ndarray,
    rows: np.ndarray,
    uv: np.ndarray,
    depth: np.ndarray,
    radius_m: np.ndarray,
    step: int,
    view: Viewpoint,
) -> None:
    """Draw discs with a radius of `step` pixels into the buffer of (depth, index) keys."""
    offset = np.arange(-step, step + 1)
    across, down = (grid.ravel() for grid in np.meshgrid(offset, offset))
    away = (across**2 + down**2) / (step + 0.4) ** 2
    across, down, away = across[away <= 1], down[away <= 1], away[away <= 1]
    centre = np.rint(uv).astype(np.int64)
    x, y = centre[:, :1] + across, centre[:, 1:] + down
    bulged = (depth[:, None] + radius_m[:, None] * away).astype(np.float32)
    # The bit patterns of positive floats have the same order as the floats.
    key = bulged.view(np.uint32).astype(np.uint64) << np.uint64(32) | rows[:, None].astype(np.uint64)
    inside = (x >= 0) & (x < view.width) & (y >= 0) & (y < view.height)
    np.minimum.at(nearest, (y * view.width + x)[inside], key[inside])


def _step_to(octaves: np.ndarray, empty: np.ndarray, across: int, down: int) -> np.ndarray:
    """Depth of each pixel minus that of its neighbour (across, down), in octaves; 0 if either is empty or outside."""
    height, width = octaves.shape
    here = (slice(max(0, -down), height - max(0, down)), slice(max(0, -across), width - max(0, across)))
    there = (slice(max(0, down), height - max(0, -down)), slice(max(0, across), width - max(0, -across)))
    step = np.zeros_like(octaves)
    known = ~(empty[here] | empty[there])
    step[here] = np.clip((octaves[here] - octaves[there]) * known, -_MAX_OCTAVES, _MAX_OCTAVES)
    return step
