"""Overhead lines: wooden poles along a street and the wires that hang between them."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import tube
from assets.world.furniture import roadside
from assets.world.ground.overlays import Heights
from assets.world.instancing import instances, poses
from assets.world.obstacles import Obstacles
from assets.world.roads.kerbside import Kerbside

_SPAN_M = (30.0, 42.0)
_POLES = (3, 9)
_STRAIGHT = 0.98  # chord over arc of a span, at least
_BEHIND_M = 0.4  # from the back of the pavement to a pole on it
_NARROWEST_M = 0.8  # pavement with poles
_WIRE_M = 0.012  # radius of an insulated wire
_SAG_PER_M = 4e-4  # sag over the square of the span: w/(8H) for H = 600 N and 2 N/m
_PIECES = 8


def overhead_lines(edge: Kerbside, blocked: Obstacles, stand_z: Heights, wanted: int, rng: np.random.Generator) -> Mesh:
    """Lines with about `wanted` poles in total, each along one side of a street.

    Poles without room are left out, and the line is interrupted there.
    """
    parts: list[Mesh] = []
    for first in rng.permutation(np.flatnonzero((edge.pavement_m > _NARROWEST_M) & (edge.junction_m > 5.0))):
        if wanted <= 0:
            break
        span, count = round(float(rng.uniform(*_SPAN_M))), int(rng.integers(*_POLES))
        rows = first + span * np.arange(min(count, wanted))
        rows = rows[rows < len(edge.run)]
        rows = rows[(edge.run[rows] == edge.run[first]) & (edge.pavement_m[rows] > _NARROWEST_M)]
        spots = edge.spots(np.maximum(edge.pavement_m - _BEHIND_M, 0.5))[rows]
        keep = blocked.free(spots, 0.35, road_m=0.2)
        keep[keep] = blocked.take(spots[keep], 0.35)
        if keep.any():
            parts.append(_line(rows[keep], spots[keep], edge, stand_z, span, rng))
            wanted -= int(keep.sum())
    return Mesh.merge(parts)


def _line(
    rows: np.ndarray, spots: np.ndarray, edge: Kerbside, stand_z: Heights, span_m: int, rng: np.random.Generator
) -> Mesh:
    pole = roadside.utility_pole(rng)
    placed = poses(np.column_stack([spots, stand_z(spots)]), edge.yaw_rad[rows])
    ends = roadside.insulators(pole)
    parts = [instances(pole, placed)]
    for k in range(len(rows) - 1):
        gap_m = float(np.linalg.norm(spots[k + 1] - spots[k]))
        if rows[k + 1] - rows[k] == span_m and gap_m > _STRAIGHT * span_m:
            start, end = (ends @ pose[:3, :3].T + pose[:3, 3] for pose in placed[k : k + 2])
            parts += [wire(*pair) for pair in zip(start, end, strict=True)]
    return Mesh.merge(parts)


def wire(start: np.ndarray, end: np.ndarray) -> Mesh:
    """A wire between two points (3,), sagging as a parabola [m]."""
    share = np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
    path = start + share * (end - start)
    path[:, 2] -= (4 * share * (1 - share) * _SAG_PER_M * np.sum((end - start) ** 2))[:, 0]
    return tube(path, _WIRE_M, "plastic_dark", segments=3)
