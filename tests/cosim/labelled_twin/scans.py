"""Scans of worlds that are formulas, made with a few lines of numpy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

ELEVATION_RAD = np.radians(np.concatenate([np.linspace(2, -8.5, 32), np.linspace(-9, -25, 32)]))
FIRINGS = 1500
HEIGHT_M = 1.73
Ground = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Block:
    """An upright box: x and y bounds and its top, LiDAR axes."""

    x: tuple[float, float]
    y: tuple[float, float]
    top: float


def scan(
    ground: Ground,
    *,
    seed: int = 0,
    error_deg: float = 0.0,
    noise_m: float = 0.01,
    blocks: tuple[Block, ...] = (),
    where: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 4) and rings (n,) of a scan, ring by ring, azimuth rising.

    Args:
        ground: z(x, y) in LiDAR axes.
        seed: of the range noise.
        error_deg: how much higher the true beams are than those the points are computed with.
        noise_m: standard deviation of range.
        blocks: boxes on the ground.
        where: whether ground at (x, y) returns anything; everywhere by default.
    """
    azimuth = np.tile(np.linspace(0, 2 * np.pi, FIRINGS, endpoint=False), len(ELEVATION_RAD))
    ring = np.repeat(np.arange(len(ELEVATION_RAD)), FIRINGS)
    true = _direction(ELEVATION_RAD[ring] + np.radians(error_deg), azimuth)
    distance = _to_ground(ground, true)
    if where is not None:
        at = true * np.minimum(distance, 1e3)[:, None]
        distance = np.where(where(at[:, 0], at[:, 1]), distance, np.inf)
    for block in blocks:
        distance = np.minimum(distance, _to_block(block, true))
    seen = distance < 80
    measured = distance[seen] + np.random.default_rng(seed).normal(0, noise_m, int(seen.sum()))
    xyz = _direction(ELEVATION_RAD[ring], azimuth)[seen] * measured[:, None]
    return np.column_stack([xyz, np.full(len(xyz), 0.3)]).astype(np.float32), ring[seen]


def flat(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.full_like(x, -HEIGHT_M) + 0 * y


def _direction(elevation: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], 1)


def _to_ground(ground: Ground, direction: np.ndarray) -> np.ndarray:
    """First crossing of the surface, by steps of 5 cm and a secant."""
    found = np.full(len(direction), np.inf)
    before = -ground(np.zeros(len(direction)), np.zeros(len(direction)))
    for distance in np.arange(1.0, 60, 0.05):
        at = direction * distance
        above = at[:, 2] - ground(at[:, 0], at[:, 1])
        crossed = np.isinf(found) & (above <= 0)
        found[crossed] = distance - 0.05 * above[crossed] / (above[crossed] - before[crossed])
        before = above
    return found


def _to_block(block: Block, direction: np.ndarray) -> np.ndarray:
    bounds = np.array([block.x, block.y, (-10.0, block.top)])
    with np.errstate(divide="ignore"):
        ends = bounds.T[:, None] / direction[None]
    near, far = ends.min(0).max(1), ends.max(0).min(1)
    return np.where((near <= far) & (near > 0), near, np.inf)
