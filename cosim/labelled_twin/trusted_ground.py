"""Trusted ground from the road cells of a scan: a mask over the ground plane, and the mesh of the surface."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation

from assets.mesh import Mesh
from cosim.drives.twin.trust import CELL_M, Trust
from cosim.labelled_twin.ground_surface import GroundSurface
from cosim.labelled_twin.road_cells import RoadCells
from cosim.labelled_twin.scatter import ground_scatter

_MAX_RESIDUAL_M = 0.05  # cells farther from the fitted surface belong to kerbs or walls
_WIDEST_GAP_M, _WIDEST_GAP_PER_M = 0.3, 0.012  # maximum gap between rings that is bridged
_OBJECT_HEIGHT_M = (0.15, 2.5)  # heights of points of objects on the ground; branches are higher
_SAMPLE_M = 0.2
_MESH_M = 1.0
_RIM_M = 2.0  # margin of the mesh around trusted ground, so that beams at its edge hit it despite their errors
GROUND_MATERIAL = "asphalt"


def trust_ground(cells: RoadCells, surface: GroundSurface, others: np.ndarray, sensor_m: np.ndarray) -> Trust:
    """Trust ground that lies between neighbouring road cells on the surface and has no objects on it.

    Args:
        cells: road cells.
        surface: surface fitted to them.
        others: (n, ≥ 3) points in LiDAR axes that do not belong to labelled objects [m].
        sensor_m: (3,) position of the sensor in the world; both have the same axes [m].
    """
    on_surface = np.abs(cells.xyz[:, 2] - surface.fitted(cells.xyz[:, :2])) < _MAX_RESIDUAL_M
    samples = _sample_between(cells.take(on_surface))
    if not len(samples):
        return Trust.nothing()
    low, high = samples.min(0), samples.max(0)
    corner = np.floor((low + sensor_m[:2]) / CELL_M) * CELL_M
    shape = np.floor((high + sensor_m[:2] - corner) / CELL_M).astype(int) + 1
    ground = np.zeros(shape, bool)
    ground[tuple(np.floor((samples + sensor_m[:2] - corner) / CELL_M).astype(int).T)] = True
    ground &= ~_occupied(surface, others, sensor_m, corner, ground.shape)
    middle = [corner[axis] + CELL_M * (np.arange(shape[axis]) + 0.5) - sensor_m[axis] for axis in (0, 1)]
    grid = np.stack(np.meshgrid(*middle, indexing="ij"), -1).reshape(-1, 2)
    height = (surface.height(grid) + sensor_m[2]).reshape(shape).astype(np.float32)
    cone = float(np.degrees(surface.cone_rad))
    scatter = ground_scatter(cells.take(on_surface), surface, grid).reshape(shape).astype(np.float32)
    return Trust(corner, CELL_M, ground, height, surface.knows_cone, cone, surface.lever_m, scatter)


def ground_mesh(trust: Trust, surface: GroundSurface, sensor_m: np.ndarray) -> Mesh:
    """Mesh of the surface under trusted ground and a margin around it, in world axes."""
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
    """Maximum gap between neighbouring rings that is bridged, (n,) [m], at distances (n,) from the sensor [m]."""
    return _WIDEST_GAP_M + _WIDEST_GAP_PER_M * reach_m**2


def _occupied(
    surface: GroundSurface, others: np.ndarray, sensor_m: np.ndarray, corner: np.ndarray, shape: tuple[int, ...]
) -> np.ndarray:
    """Cells that contain objects on the ground, bool of the given shape."""
    row = np.floor((others[:, :2].astype(np.float64) + sensor_m[:2] - corner) / CELL_M).astype(int)
    inside = np.flatnonzero(np.all((row >= 0) & (row < shape), axis=1))
    above = others[inside, 2] - surface.fitted(others[inside, :2].astype(np.float64))
    on_object = inside[(above > _OBJECT_HEIGHT_M[0]) & (above < _OBJECT_HEIGHT_M[1])]
    occupied = np.zeros(shape, bool)
    occupied[tuple(row[on_object].T)] = True
    return occupied


def _sample_between(cells: RoadCells) -> np.ndarray:
    """Positions (k, 2) sampled on the ground between neighbouring road cells [m]."""
    rings = int(cells.ring.max(initial=0)) + 1
    row = np.full((rings + 2, cells.sectors), -1)
    row[cells.ring, cells.sector] = np.arange(len(cells))
    polar = np.column_stack([cells.reach_m, np.arctan2(cells.xyz[:, 1], cells.xyz[:, 0])])
    below, under_it = (row[cells.ring + step, cells.sector] for step in (1, 2))
    below = np.where(below >= 0, below, under_it)  # bridge a ring without returns, so that its drops are counted
    gap = np.where(below >= 0, polar[:, 0] - polar[below, 0], 0)
    depth = np.where((gap > 0) & (gap < widest_gap_m(polar[:, 0])), gap, 0)
    middle = -np.pi + (cells.sector + 0.5) * 2 * np.pi / cells.sectors
    samples = []
    for inward in np.arange(0, max(float(depth.max(initial=0)), _SAMPLE_M), _SAMPLE_M):
        reached = inward <= depth
        reach = polar[reached, 0] - inward
        for offset in (-0.4, 0.0, 0.4):
            azimuth = middle[reached] + offset * 2 * np.pi / cells.sectors
            samples.append(np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth)]))
    return np.concatenate(samples) if samples else np.zeros((0, 2))
