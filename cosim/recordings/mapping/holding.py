"""Degeneracy of registration: how well the surfaces in a scan determine its pose.

Registration of a scan to planes is not determined along a direction without normals: along a tunnel, or across an open
plain (Zhang, Kaess, Singh, On degeneracy of optimization-based state estimation problems, ICRA 2016). Odometry does not
report a failure there: the rings on walls travel with the sensor, so that it finds no motion, and the resulting map is
sharp. Therefore normals are those of patches that several lasers hit in a single scan.
"""

from __future__ import annotations

import numpy as np

from cosim.recordings.mapping.surfels import planes

_PATCH_DEG = (6.0, 5.0)  # azimuth and elevation; in 5° of elevation every sensor has two lasers or more
_LEAST_POINTS, _LEAST_SPREAD_DEG = 15, 0.3  # of a patch, and of its points' elevations: one laser draws no plane
_THICKEST_M, _LEAST_SHAPE = 0.05, 4.0  # across a plane, and times that along it
_LEAST_PLANES = 0.8  # share of points on planes: 0.85 and more in bare tunnels; streets have 0.7, and much that holds


def holding(xyz: np.ndarray) -> float:
    """Smallest eigenvalue of the information about a scan's position, from 0 to 1/3.

    The smallest eigenvalue of the mean of n·nᵀ over points on planes of normals n; 1/3 where a fifth of the points
    lies on none, as corners, cars and poles hold a scan, too.

    Args:
        xyz: (n, 3) points in the sensor's axes.
    """
    patch, elevation = _patches(xyz)
    count = np.bincount(patch)
    _, normal, variance = planes(xyz, patch, len(count))
    sd = np.sqrt(variance)
    spread = np.sqrt(_variance(elevation, patch))
    good = (count >= _LEAST_POINTS) & (spread > np.radians(_LEAST_SPREAD_DEG))
    points = float(count[good].sum())
    good &= (sd[:, 0] < _THICKEST_M) & (sd[:, 1] > _LEAST_SHAPE * sd[:, 0])
    on = float(count[good].sum())
    if not points or on < _LEAST_PLANES * points:
        return 1 / 3
    weighted = normal[good] * count[good, None]
    return float(np.linalg.eigvalsh(weighted.T @ normal[good])[0] / on)


def _patches(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number of each point's patch (n,) from 0, and its elevation (n,) [rad]."""
    elevation = np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])).astype(np.float64)
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    wide, high = np.radians(_PATCH_DEG)
    cell = np.floor(azimuth / wide).astype(int) * 1000 + np.floor(elevation / high).astype(int)
    return np.unique(cell, return_inverse=True)[1].reshape(-1), elevation


def _variance(values: np.ndarray, patch: np.ndarray) -> np.ndarray:
    count = np.bincount(patch)
    rest = values - (np.bincount(patch, values) / count)[patch]
    return np.bincount(patch, rest**2) / count
