"""From the cells of a scan's road to trusted ground: a mask over the ground plane, and the mesh of the surface."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation

from assets.mesh import Mesh
from cosim.drives.twin.trust import CELL_M, Trust
from cosim.labelled_twin.ground_surface import GroundSurface
from cosim.labelled_twin.road_cells import RoadCells
from cosim.labelled_twin.scatter import ground_scatter

_FOLLOWS_M = 0.05  # a cell farther from the surface with its cone is a kerb's or a wall's foot
_WIDEST_GAP_M, _WIDEST_GAP_PER_M = 0.3, 0.012  # rings farther apart leave the ground between unseen
_STANDS_M = (0.15, 2.5)  # heights of what stands on the ground; branches hang higher
_SAMPLE_M = 0.2
_MESH_M = 1.0
_RIM_M = 2.0  # of mesh around trusted ground, so that beams at its rim meet it whatever their error
GROUND_MATERIAL = "asphalt"


def trust_ground(cells: RoadCells, surface: GroundSurface, others: np.ndarray, sensor_m: np.ndarray) -> Trust:
    """Cells of the ground plane between neighbouring road cells that the surface follows, with nothing on them.

    Args:
        cells: of the road.
        surface: fitted to them.
        others: (n, ≥ 3) points in LiDAR axes that belong to no labelled object.
        sensor_m: (3,) world place of the sensor, whose axes are the world's.
    """
    follows = np.abs(cells.xyz[:, 2] - surface.fitted(cells.xyz[:, :2])) < _FOLLOWS_M
    places = _covered(cells.take(follows))
    if not len(places):
        return Trust.nothing()
    low, high = places.min(0), places.max(0)
    corner = np.floor((low + sensor_m[:2]) / CELL_M) * CELL_M
    shape = np.floor((high + sensor_m[:2] - corner) / CELL_M).astype(int) + 1
    ground = np.zeros(shape, bool)
    ground[tuple(np.floor((places + sensor_m[:2] - corner) / CELL_M).astype(int).T)] = True
    ground &= ~_occupied(surface, others, sensor_m, corner, ground.shape)
    middle = [corner[axis] + CELL_M * (np.arange(shape[axis]) + 0.5) - sensor_m[axis] for axis in (0, 1)]
    grid = np.stack(np.meshgrid(*middle, indexing="ij"), -1).reshape(-1, 2)
    height = (surface.height(grid) + sensor_m[2]).reshape(shape).astype(np.float32)
    cone = float(np.degrees(surface.cone_rad))
    scatter = ground_scatter(cells.take(follows), surface, grid).reshape(shape).astype(np.float32)
    return Trust(corner, CELL_M, ground, height, surface.knows_cone, cone, surface.lever_m, scatter)


def ground_mesh(trust: Trust, surface: GroundSurface, sensor_m: np.ndarray) -> Mesh:
    """The surface under trusted ground and a rim around it, in world axes."""
    grown = binary_dilation(np.pad(trust.ground, 4), iterations=round(_RIM_M / CELL_M))
    step = round(_MESH_M / CELL_M)
    count = [-(-size // step) for size in grown.shape]
    padded = np.pad(grown, [(0, n * step - size) for n, size in zip(count, grown.shape, strict=True)])
    quads = padded.reshape(count[0], step, count[1], step).any((1, 3))
    corner = trust.corner_m - 4 * CELL_M
    x, y = (corner[axis] + _MESH_M * np.arange(count[axis] + 1) for axis in (0, 1))
    xy = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    z = surface.height(xy - sensor_m[:2]) + sensor_m[2]
    i, j = np.nonzero(quads)
    a = i * (count[1] + 1) + j
    b, c, d = a + count[1] + 1, a + count[1] + 2, a + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    mesh = Mesh.of(np.column_stack([xy, z]), faces, GROUND_MATERIAL)
    return mesh.select(np.ones(len(faces), bool))


def widest_gap_m(reach_m: np.ndarray) -> np.ndarray:
    """How far apart neighbouring rings may meet the ground at distances (n,) from the sensor and still be bridged."""
    return _WIDEST_GAP_M + _WIDEST_GAP_PER_M * reach_m**2


def _occupied(
    surface: GroundSurface, others: np.ndarray, sensor_m: np.ndarray, corner: np.ndarray, shape: tuple[int, ...]
) -> np.ndarray:
    """Cells in which something stands on the ground."""
    row = np.floor((others[:, :2].astype(np.float64) + sensor_m[:2] - corner) / CELL_M).astype(int)
    inside = np.flatnonzero(np.all((row >= 0) & (row < shape), axis=1))
    above = others[inside, 2] - surface.fitted(others[inside, :2].astype(np.float64))
    stands = inside[(above > _STANDS_M[0]) & (above < _STANDS_M[1])]
    occupied = np.zeros(shape, bool)
    occupied[tuple(row[stands].T)] = True
    return occupied


def _covered(cells: RoadCells) -> np.ndarray:
    """Places (k, 2) spread over the ground between road cells that are neighbours in azimuth and ring."""
    rings = int(cells.ring.max(initial=0)) + 1
    row = np.full((rings + 2, cells.sectors), -1)
    row[cells.ring, cells.sector] = np.arange(len(cells))
    polar = np.column_stack([cells.reach_m, np.arctan2(cells.xyz[:, 1], cells.xyz[:, 0])])
    below, under_it = (row[cells.ring + step, cells.sector] for step in (1, 2))
    below = np.where(below >= 0, below, under_it)  # a weak laser's ring may be missing: its losses are to be counted
    gap = np.where(below >= 0, polar[:, 0] - polar[below, 0], 0)
    depth = np.where((gap > 0) & (gap < widest_gap_m(polar[:, 0])), gap, 0)
    middle = -np.pi + (cells.sector + 0.5) * 2 * np.pi / cells.sectors
    places = []
    for inward in np.arange(0, max(float(depth.max(initial=0)), _SAMPLE_M), _SAMPLE_M):
        reached = inward <= depth
        reach = polar[reached, 0] - inward
        for aside in (-0.4, 0.0, 0.4):
            azimuth = middle[reached] + aside * 2 * np.pi / cells.sectors
            places.append(np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth)]))
    return np.concatenate(places) if places else np.zeros((0, 2))
