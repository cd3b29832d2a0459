"""Uncertainty of a twin made from labels: scatter of the points about its surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy.spatial import KDTree

from assets import build_model
from cosim.drives.twin import Instance
from cosim.drives.twin.trust import in_box
from cosim.labelled_twin.ground_surface import GroundSurface
from cosim.labelled_twin.road_cells import RoadCells

_NEIGHBOURS = 30
_MIN_SD_M = 0.005
_SAMPLES = 20_000  # samples of a model's surface, 3 to 5 cm apart
_MIN_POINTS = 20
_DEFAULT_SD_M = 0.15  # for objects with too few points
_MARGIN_M = 0.3


def ground_scatter(cells: RoadCells, surface: GroundSurface, xy: np.ndarray) -> np.ndarray:
    """Standard deviation (n,) [m] about the fitted surface of the road cells nearest to positions (n, 2)."""
    residual = cells.xyz[:, 2] - surface.fitted(cells.xyz[:, :2])
    count = min(_NEIGHBOURS, len(cells))
    _, nearest = KDTree(cells.xyz[:, :2]).query(xy, k=count)
    return np.maximum(np.sqrt((residual[nearest.reshape(len(xy), count)] ** 2).mean(1)), _MIN_SD_M)


def body_scatter(instances: Sequence[Instance], xyz: np.ndarray) -> np.ndarray:
    """Rms distance (i,) [m] from the points (n, 3), world axes, in each box to the surface of its model."""
    scatter = np.full(len(instances), _DEFAULT_SD_M)
    for row, instance in enumerate(instances):
        inside = xyz[in_box(xyz, instance, _MARGIN_M)]
        local = (inside - instance.pose[:3, 3]) @ instance.pose[:3, :3]
        local = local[local[:, 2] > _MARGIN_M / 2]  # exclude points on the road
        if len(local) >= _MIN_POINTS:
            scale = np.asarray(instance.scale, float)
            distance, _ = KDTree(_sample_surface(instance.model) * scale).query(local)
            scatter[row] = max(float(np.sqrt((distance**2).mean())), _MIN_SD_M)
    return scatter


@cache
def _sample_surface(model: str) -> np.ndarray:
    """Uniform random points (m, 3) on a model's surface, in its own axes."""
    corners = build_model(model).triangles.astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    rng = np.random.default_rng(0)
    face = rng.choice(len(corners), _SAMPLES, p=area / area.sum())
    u, v = np.sort(rng.random((2, _SAMPLES)), axis=0)
    weights = np.stack([u, v - u, 1 - v], 1)
    return np.einsum("nk,nkj->nj", weights, corners[face])
