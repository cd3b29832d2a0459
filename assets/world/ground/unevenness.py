"""Unevenness of the ground: cross slope of roads, settled subsoil, irregular slabs and verges.

Heights about the smooth surface are a sum of octaves, each a random B-spline of its own spacing. As on real ground,
second differences of height along a line grow nearly with their lag (of roads: ISO 8608). How much of it each zone has
follows real scans, see tests/bench/ground.py.
"""

from __future__ import annotations

import zlib

import numpy as np
from scipy.spatial import KDTree

from assets.world.ground.plan import CARRIAGEWAY, PAVEMENT, TERRAIN, SurfacePlan, zone_borders

_CROSSFALL, _FALLS_FROM_M = 0.015, 4.0  # rise over run towards the gutter, from this far on either side
_SETTLED_M = 0.009  # deviation of each octave on all ground
_SETTLED_SPACINGS_M = (1.0, 2.0, 4.0)
_LOOSE_M = {CARRIAGEWAY: 0.0, PAVEMENT: 0.008, TERRAIN: 0.050}  # deviation of what a zone has besides
_LOOSE_SPACINGS_M = (0.8, 1.6)
_SPLINE = 2.0 / 3.0, 1.0 / 6.0  # a cubic B-spline at its central knot and the next ones


def unevenness(plan: SurfacePlan, name: str) -> np.ndarray:
    """Heights (n,) in metres of a plan's points over the smooth surface.

    Args:
        plan: the triangulated plan.
        name: of the town, from which all chance follows.
    """
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    zone = _inner_zone(plan)
    loose = np.array([_LOOSE_M[k] for k in (CARRIAGEWAY, PAVEMENT, TERRAIN)])[zone]
    settled = sum(_SETTLED_M * _octave(plan.points, m, rng) for m in _SETTLED_SPACINGS_M)
    rough = sum(_octave(plan.points, m, rng) for m in _LOOSE_SPACINGS_M) / np.sqrt(len(_LOOSE_SPACINGS_M))
    return settled + loose * rough + _crossfall(plan)


def _inner_zone(plan: SurfacePlan) -> np.ndarray:
    """Zone (n,) of every point; on a border that of the more even side."""
    zone = np.full(len(plan.points), TERRAIN)
    for one in (PAVEMENT, CARRIAGEWAY):
        zone[plan.faces[plan.zone == one]] = one
    return zone


def _octave(points: np.ndarray, spacing_m: float, rng: np.random.Generator) -> np.ndarray:
    """A random B-spline of unit deviation on average, at points (n, 2)."""
    from scipy.ndimage import map_coordinates

    low = points.min(0)
    control = rng.standard_normal(tuple(np.ceil((points.max(0) - low) / spacing_m).astype(int) + 4))
    middle, beside = _SPLINE
    knot = middle**2 + 2 * beside**2  # variance at a knot and, half way between two, of the spline along one axis
    half = 2 * ((23.0 / 48.0) ** 2 + (1.0 / 48.0) ** 2)
    value = map_coordinates(control, ((points - low) / spacing_m).T + 1.0, order=3, mode="nearest", prefilter=False)
    return value / ((knot + half) / 2)


def _crossfall(plan: SurfacePlan) -> np.ndarray:
    """Roads and pavements fall to the line where they meet; gutters lie lowest."""
    start, end, zone, _ = zone_borders(plan)
    edge = zone == CARRIAGEWAY
    first, last = plan.points[start[edge]], plan.points[end[edge]]
    along = np.concatenate([first + share * (last - first) for share in (0.0, 0.25, 0.5, 0.75)])
    away, _ = KDTree(along).query(plan.points, distance_upper_bound=_FALLS_FROM_M)
    return _CROSSFALL * (np.minimum(away, _FALLS_FROM_M) - _FALLS_FROM_M / 2)
