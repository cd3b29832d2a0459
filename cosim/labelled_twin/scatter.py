"""How far a twin made from labels and points may be off: how these scatter about it."""

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
_LEAST_M = 0.005
_SAMPLES = 20_000  # of a model's surface: 3 to 5 cm apart
_FEWEST = 20
_UNSEEN_M = 0.15  # of bodies with too few points to tell
_MARGIN_M = 0.3


def ground_scatter(cells: RoadCells, surface: GroundSurface, xy: np.ndarray) -> np.ndarray:
    """Standard deviation (n,) [m] of road cells about the surface with its cone, of those next to places (n, 2)."""
    away = cells.xyz[:, 2] - surface.fitted(cells.xyz[:, :2])
    count = min(_NEIGHBOURS, len(cells))
    _, near = KDTree(cells.xyz[:, :2]).query(xy, k=count)
    return np.maximum(np.sqrt((away[near.reshape(len(xy), count)] ** 2).mean(1)), _LEAST_M)


def body_scatter(instances: Sequence[Instance], xyz: np.ndarray) -> np.ndarray:
    """Root of the mean square distance (i,) [m] from returns (n, 3), world axes, in each box to its model's surface."""
    found = np.full(len(instances), _UNSEEN_M)
    for row, instance in enumerate(instances):
        inside = xyz[in_box(xyz, instance, _MARGIN_M)]
        local = (inside - instance.pose[:3, 3]) @ instance.pose[:3, :3]
        local = local[local[:, 2] > _MARGIN_M / 2]  # the road under it is none of its points
        if len(local) >= _FEWEST:
            scale = np.asarray(instance.scale, float)
            away, _ = KDTree(_surface(instance.model) * scale).query(local)
            found[row] = max(float(np.sqrt((away**2).mean())), _LEAST_M)
    return found


@cache
def _surface(model: str) -> np.ndarray:
    """Places spread evenly over a model's surface (m, 3), in its own axes."""
    corners = build_model(model).triangles.astype(np.float64)
    across = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    rng = np.random.default_rng(0)
    face = rng.choice(len(corners), _SAMPLES, p=across / across.sum())
    u, v = np.sort(rng.random((2, _SAMPLES)), axis=0)
    weights = np.stack([u, v - u, 1 - v], 1)
    return np.einsum("nk,nkj->nj", weights, corners[face])
