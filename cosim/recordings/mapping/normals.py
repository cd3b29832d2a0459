"""Planes through points, and normals of small planes from those around them, where most lie on one larger plane.

The points of a cell of a few decimetres determine its normal to one or two degrees. Where beams graze the ground, this
is as much as the angle between beam and surface, and everything that depends on the incidence would be underestimated
(attenuation by errors in variables: Fuller, Measurement Error Models, Wiley 1987).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

_REACH = 2.5  # cells, of the neighbours
_MOST = 24  # neighbours
_FEWEST = 6
_MAJORITY = 0.5  # of the planes around, at least, lie on the larger plane
_AGREEING = np.cos(np.radians(30.0))  # between the normals of neighbours on one plane
_SIGMAS, _LEAST_M = 3.0, 0.005


def planes(
    xyz: np.ndarray, cell: np.ndarray, cells: int, weight: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean (m, 3), normal (m, 3) and variances along the axes (m, 3), the smallest first, of the points of cells.

    Args:
        xyz: (n, 3) points [m].
        cell: (n,) number of the cell of each.
        cells: number m of cells.
        weight: (n,) of the points, a number of points or 0; by default all 1.
    """

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(cell, values if weight is None else weight * values, cells)

    count = np.maximum(np.bincount(cell, weight, cells), 1)
    centre = np.stack([total(xyz[:, axis]) for axis in range(3)], 1) / count[:, None]
    rest = xyz - centre[cell]
    scatter = np.empty((cells, 3, 3))
    for a in range(3):
        for b in range(a, 3):
            scatter[:, a, b] = scatter[:, b, a] = total(rest[:, a] * rest[:, b]) / count
    variance, axes = np.linalg.eigh(scatter)
    return centre, axes[:, :, 0], np.maximum(variance, 0.0)


def steadied(centre: np.ndarray, normal: np.ndarray, points: np.ndarray, sd_m: np.ndarray, cell_m: float) -> np.ndarray:
    """Unit normals (m, 3) of planes, from the centres of those around if most of these lie on one larger plane.

    Others keep their own. The sign is that of the given normals of the majority of the points.

    Args:
        centre: (m, 3) of the planes [m].
        normal: (m, 3) unit normals of their own points.
        points: (m,) number of points of each.
        sd_m: (m,) standard deviation of points across the plane [m].
        cell_m: size of a cell [m].
    """
    if len(centre) <= _FEWEST:
        return normal
    away, others = KDTree(centre).query(centre, k=min(_MOST + 1, len(centre)), distance_upper_bound=_REACH * cell_m)
    exists = np.isfinite(away)
    away, others = np.where(exists, away, 0.0), np.where(exists, others, 0)
    rest = centre[others] - centre[:, None]
    off = np.abs(np.einsum("mkj,mj->mk", rest, normal))
    agree = np.abs(np.einsum("mkj,mj->mk", normal[others], normal)) > _AGREEING
    # standard errors of the mean of the points of a cell, and of the slope of the plane through them
    mean_m = sd_m / np.sqrt(points)
    slope = mean_m / (cell_m / np.sqrt(12))
    room_m = _LEAST_M + _SIGMAS * np.hypot(mean_m[:, None], slope[:, None] * away)
    on_plane = exists & agree & (off <= room_m)
    weight = points[others] * on_plane.astype(float)
    cell = np.repeat(np.arange(len(centre)), rest.shape[1])
    _, axes, variance = planes(rest.reshape(-1, 3), cell, len(centre), weight.ravel())
    spread_m = np.sqrt(variance)
    is_flat = (
        (on_plane.sum(1) >= np.maximum(_FEWEST, _MAJORITY * exists.sum(1)))
        & (spread_m[:, 0] <= _LEAST_M + _SIGMAS * mean_m)
        & (spread_m[:, 1] >= cell_m / 2)
    )
    side = np.einsum("mk,mkj,mj->m", weight, normal[others], axes)
    axes = np.where(side[:, None] < 0, -axes, axes)
    return np.where(is_flat[:, None], axes, normal)
