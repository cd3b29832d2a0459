"""Segment the connected ground around the sensor: small cells of one ring, joined where their heights are continuous.

A cell contains the points of one ring within one degree of azimuth, or more for sensors with few firings. Two cells
are joined if the height step between them is that of a road; kerbs, verges, vegetation and objects separate cells.
Cells are selected only by the steps to their neighbours, never by their distance from the fitted surface, because that
would remove the residuals that errors of the sensor cause.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

_MAX_SECTORS, _MIN_SECTORS = 360, 36  # sectors per revolution
_SECTOR_POINTS = 4  # minimum number of points in a sector of a complete ring
_MIN_RANGE_M = 3.0  # closer points are on the ego vehicle
_MIN_POINTS = 3  # per cell
_MIN_GROUND_SHARE = 0.9  # minimum share of ground points among the points of a cell; excludes cells with poles
_SPREAD_M, _SPREAD_PER_M = 0.05, 0.0015  # maximum difference of the 90 % and 10 % quantiles of the heights in a cell
_ACROSS_STEP_M = 0.03  # maximum step between neighbouring cells of a ring
_ALONG_STEP_M, _ALONG_SLOPE = 0.02, 0.015  # maximum step and slope between neighbouring rings, relative to the plane
_MAX_STEP_M = 0.06  # upper bound of the step between rings: half a kerb
_MAX_HEIGHT_M = 0.5  # maximum distance from the plane
_NEAR_M = 14.0  # range within which the plane is fitted
_WIDTHS_M = (0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.1)


@dataclass(frozen=True, eq=False)
class RoadCells:
    """Cells of the connected ground around the sensor, in LiDAR axes.

    Attributes:
        xyz: (n, 3) float64 mean horizontal position and median height [m].
        ring: (n,) int ring number.
        sector: (n,) int sector number, from azimuth −π.
        points: (n,) int number of points.
        area_m2: (n,) float64 area of ground that the cell represents [m²].
        sectors: number of sectors per revolution.
    """

    xyz: np.ndarray
    ring: np.ndarray
    sector: np.ndarray
    points: np.ndarray
    area_m2: np.ndarray
    sectors: int

    def __len__(self) -> int:
        return len(self.ring)

    @property
    def reach_m(self) -> np.ndarray:
        """Horizontal distances from the sensor, (n,) [m]."""
        return np.hypot(self.xyz[:, 0], self.xyz[:, 1])

    def take(self, rows: np.ndarray) -> RoadCells:
        """Select cells by mask or index."""
        ring, sector, points = self.ring[rows], self.sector[rows], self.points[rows]
        return RoadCells(self.xyz[rows], ring, sector, points, self.area_m2[rows], self.sectors)


def find_road_cells(points: np.ndarray, ring: np.ndarray, on_objects: np.ndarray, reach_m: float) -> RoadCells:
    """Find the largest connected ground region around the sensor; empty if there is none.

    Args:
        points: (n, ≥ 3) points in LiDAR axes [m].
        ring: (n,) ring of each point, 0 on top.
        on_objects: (n,) bool, points that belong to labelled objects.
        reach_m: maximum horizontal distance [m].
    """
    rings = int(ring.max(initial=0)) + 1
    most_points = int(np.bincount(ring.astype(np.int64), minlength=1).max())
    sectors = int(np.clip(most_points // _SECTOR_POINTS, _MIN_SECTORS, _MAX_SECTORS))
    grid = _Grid.of(points, ring.astype(np.int64), on_objects, reach_m, rings, sectors)
    plane = _fit_near_plane(grid)
    if plane is None:
        none = np.zeros(0, int)
        return RoadCells(np.zeros((0, 3)), none, none, none, np.zeros(0), sectors)
    kept = np.flatnonzero(_largest_component(grid, plane))
    cells_ring, sector = kept // sectors, kept % sectors
    reach = np.hypot(grid.xyz[kept, 0], grid.xyz[kept, 1])
    depth = _ring_gap(grid, rings)[kept]
    area = reach * (2 * np.pi / sectors) * np.clip(depth, 0.05, 0.3 * reach)
    return RoadCells(grid.xyz[kept], cells_ring, sector, grid.points[kept], area, sectors)


@dataclass(frozen=True, eq=False)
class _Grid:
    """All cells, ring-major: position (m, 3), spread of heights (m,), points (m,), whether all points can be ground."""

    xyz: np.ndarray
    spread: np.ndarray
    points: np.ndarray
    is_ground_only: np.ndarray
    sectors: int

    @classmethod
    def of(
        cls, points: np.ndarray, ring: np.ndarray, on_objects: np.ndarray, reach_m: float, rings: int, sectors: int
    ) -> _Grid:
        xyz = points[:, :3].astype(np.float64)
        reach, azimuth = np.hypot(xyz[:, 0], xyz[:, 1]), np.arctan2(xyz[:, 1], xyz[:, 0])
        cell = ring * sectors + ((azimuth + np.pi) / (2 * np.pi) * sectors).astype(int) % sectors
        size = rings * sectors
        rows = np.flatnonzero(~on_objects & (reach > _MIN_RANGE_M) & (reach < reach_m) & (xyz[:, 2] < 0))
        rows = rows[np.lexsort((xyz[rows, 2], cell[rows]))]
        filled, first, count = np.unique(cell[rows], return_index=True, return_counts=True)

        def quantile(share: float) -> np.ndarray:
            return xyz[rows[first + np.minimum((share * count).astype(int), count - 1)], 2]

        centre, spread, number = np.full((size, 3), np.nan), np.full(size, np.nan), np.zeros(size, int)
        if len(filled):
            centre[filled, :2] = np.add.reduceat(xyz[rows, :2], first) / count[:, None]
            centre[filled, 2], spread[filled], number[filled] = quantile(0.5), quantile(0.9) - quantile(0.1), count
        all_points = np.bincount(cell, minlength=size)
        is_ground_only = (number >= _MIN_POINTS) & (number >= _MIN_GROUND_SHARE * all_points)
        return cls(centre, spread, number, is_ground_only, sectors)


def _fit_near_plane(grid: _Grid) -> np.ndarray | None:
    """Fit the plane z = a + b·x + c·y (3,) to the ground nearby, from the modal height and with Tukey's weights."""
    reach = np.hypot(grid.xyz[:, 0], grid.xyz[:, 1])
    near = grid.is_ground_only & (reach < _NEAR_M) & (grid.spread < _SPREAD_M)
    if np.count_nonzero(near) < grid.sectors // 10:
        return None
    x, y, z = grid.xyz[near].T
    counts, edges = np.histogram(z, np.arange(z.min() - 0.2, z.max() + 0.4, 0.2))
    plane = np.array([edges[counts.argmax()] + 0.1, 0.0, 0.0])
    design = np.column_stack([np.ones_like(x), x, y])
    for width in _WIDTHS_M:
        weight = np.clip(1 - ((z - design @ plane) / width) ** 2, 0, None)
        plane = np.linalg.lstsq(design * weight[:, None], z * weight, rcond=None)[0]
    return plane


def _largest_component(grid: _Grid, plane: np.ndarray) -> np.ndarray:
    """Cells of the largest connected component, (m,) bool."""
    reach = np.hypot(grid.xyz[:, 0], grid.xyz[:, 1])
    height = grid.xyz[:, 2] - plane[0] - grid.xyz[:, :2] @ plane[1:]
    good = grid.is_ground_only & (grid.spread < _SPREAD_M + _SPREAD_PER_M * reach) & (np.abs(height) < _MAX_HEIGHT_M)
    shape = (-1, grid.sectors)
    good, height, reach = good.reshape(shape), height.reshape(shape), reach.reshape(shape)
    number = np.arange(good.size).reshape(shape)
    ends: list[tuple[np.ndarray, np.ndarray]] = []
    is_linked = np.zeros_like(good)
    for step in (1, 2):  # step 2 skips a laser without returns
        near, far = (slice(step, None), slice(None, -step)) if len(good) > step else (slice(0, 0), slice(0, 0))
        gap = reach[far] - reach[near]  # rings are ordered from the top, so the next ring is nearer
        along = good[far] & good[near] & (gap > -0.05) & (gap < step * (0.3 + 0.012 * reach[far] ** 2))
        along &= np.abs(height[far] - height[near]) < np.clip(_ALONG_STEP_M + _ALONG_SLOPE * gap, 0, _MAX_STEP_M)
        if step == 2:
            along &= ~is_linked[1:-1]
        is_linked[far] |= along
        is_linked[near] |= along
        ends.append((number[far][along], number[near][along]))
    # On the face of a kerb a ring rises smoothly, but the steps to the rings above and below it are steep.
    good &= is_linked
    neighbour = [np.roll(array, -1, axis=1) for array in (good, height, reach, number)]
    across = good & neighbour[0] & (np.abs(height - neighbour[1]) < _ACROSS_STEP_M)
    across &= np.abs(reach - neighbour[2]) < 0.3 + 0.15 * reach
    ends.append((number[across], neighbour[3][across]))
    first, second = (np.concatenate(side) for side in zip(*ends, strict=True))
    links = coo_matrix((np.ones(len(first), bool), (first, second)), shape=(good.size, good.size))
    component = connected_components(links, directed=False)[1]
    flat = good.reshape(-1)
    sizes = np.bincount(component[flat], minlength=1)
    return flat & (component == sizes.argmax())


def _ring_gap(grid: _Grid, rings: int) -> np.ndarray:
    """Distance from each cell to the next ring below it, (m,) [m]; 0.05 m if that ring has no cell there."""
    reach = np.hypot(grid.xyz[:, 0], grid.xyz[:, 1]).reshape(rings, grid.sectors)
    below = np.vstack([reach[1:], np.full((1, grid.sectors), np.nan)])
    return np.nan_to_num((reach - below).reshape(-1), nan=0.05)
