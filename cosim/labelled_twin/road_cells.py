"""The ground that a scan shows without a break around the sensor: small cells of a ring, joined where they meet evenly.

A cell is what one ring returns from a degree of azimuth, or from more where a sensor fires seldom. Cells join where
the step between them is that of a road: kerbs, verges, vegetation and whatever stands on the ground part them. Cells
are kept or left as a whole and by how they meet their neighbours, never by how far they lie from a surface fitted
later: that would cut off the very residuals which a sensor's faults leave.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

_FINEST, _COARSEST = 360, 36  # sectors of a turn
_POINTS = 4  # that a sector of a full ring holds at least
_NEAREST_M = 3.0  # nearer points are the own vehicle's
_FEWEST = 3  # points a cell
_LEAST_SHARE = 0.9  # of a ring's points in a sector that are ground; a pole beside the road stands in fewer
_SPREAD_M, _SPREAD_PER_M = 0.05, 0.0015  # 10 % to 90 % of heights within a cell
_ACROSS_STEP_M = 0.03  # between neighbours of a ring
_ALONG_STEP_M, _ALONG_SLOPE = 0.02, 0.015  # between neighbouring rings, against the plane's slope
_HIGHEST_STEP_M = 0.06  # however far apart rings are: half a kerb
_LEVEL_M = 0.5  # farthest from the plane
_NEAR_M = 14.0  # where the plane is fitted
_WIDTHS_M = (0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.1)


@dataclass(frozen=True, eq=False)
class RoadCells:
    """Cells of one piece of ground around the sensor, LiDAR axes.

    Attributes:
        xyz: (n, 3) float64 mean place and median height [m].
        ring: (n,) int.
        sector: (n,) int, counted from −π on.
        points: (n,) int, how many points each stands for.
        area_m2: (n,) float64, ground each stands for.
        sectors: of a turn.
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
        """Horizontal distances from the sensor, (n,)."""
        return np.hypot(self.xyz[:, 0], self.xyz[:, 1])

    def take(self, rows: np.ndarray) -> RoadCells:
        """Some of the cells, by mask or index."""
        ring, sector, points = self.ring[rows], self.sector[rows], self.points[rows]
        return RoadCells(self.xyz[rows], ring, sector, points, self.area_m2[rows], self.sectors)


def find_road_cells(points: np.ndarray, ring: np.ndarray, taken: np.ndarray, reach_m: float) -> RoadCells:
    """The largest even piece of ground around the sensor; empty where there is none.

    Args:
        points: (n, ≥ 3) in LiDAR axes [m].
        ring: (n,) of each point, 0 on top.
        taken: (n,) bool, points that belong to labelled objects.
        reach_m: how far to look.
    """
    rings = int(ring.max(initial=0)) + 1
    fullest = int(np.bincount(ring.astype(np.int64), minlength=1).max())
    sectors = int(np.clip(fullest // _POINTS, _COARSEST, _FINEST))
    grid = _Grid.of(points, ring.astype(np.int64), taken, reach_m, rings, sectors)
    plane = _near_plane(grid)
    if plane is None:
        none = np.zeros(0, int)
        return RoadCells(np.zeros((0, 3)), none, none, none, np.zeros(0), sectors)
    kept = np.flatnonzero(_largest_piece(grid, plane))
    cells_ring, sector = kept // sectors, kept % sectors
    reach = np.hypot(grid.xyz[kept, 0], grid.xyz[kept, 1])
    depth = _ring_gap(grid, rings)[kept]
    area = reach * (2 * np.pi / sectors) * np.clip(depth, 0.05, 0.3 * reach)
    return RoadCells(grid.xyz[kept], cells_ring, sector, grid.points[kept], area, sectors)


@dataclass(frozen=True, eq=False)
class _Grid:
    """All cells, ring-major: place (m, 3), spread of heights (m,), points (m,), whether all of it is ground-like."""

    xyz: np.ndarray
    spread: np.ndarray
    points: np.ndarray
    whole: np.ndarray
    sectors: int

    @classmethod
    def of(
        cls, points: np.ndarray, ring: np.ndarray, taken: np.ndarray, reach_m: float, rings: int, sectors: int
    ) -> _Grid:
        xyz = points[:, :3].astype(np.float64)
        reach, azimuth = np.hypot(xyz[:, 0], xyz[:, 1]), np.arctan2(xyz[:, 1], xyz[:, 0])
        cell = ring * sectors + ((azimuth + np.pi) / (2 * np.pi) * sectors).astype(int) % sectors
        size = rings * sectors
        rows = np.flatnonzero(~taken & (reach > _NEAREST_M) & (reach < reach_m) & (xyz[:, 2] < 0))
        rows = rows[np.lexsort((xyz[rows, 2], cell[rows]))]
        own, first, count = np.unique(cell[rows], return_index=True, return_counts=True)

        def quantile(share: float) -> np.ndarray:
            return xyz[rows[first + np.minimum((share * count).astype(int), count - 1)], 2]

        place, spread, number = np.full((size, 3), np.nan), np.full(size, np.nan), np.zeros(size, int)
        if len(own):
            place[own, :2] = np.add.reduceat(xyz[rows, :2], first) / count[:, None]
            place[own, 2], spread[own], number[own] = quantile(0.5), quantile(0.9) - quantile(0.1), count
        all_points = np.bincount(cell, minlength=size)
        return cls(place, spread, number, (number >= _FEWEST) & (number >= _LEAST_SHARE * all_points), sectors)


def _near_plane(grid: _Grid) -> np.ndarray | None:
    """z = a + b·x + c·y of the ground nearby, (3,): begun at the commonest height, refined by Tukey's weights."""
    reach = np.hypot(grid.xyz[:, 0], grid.xyz[:, 1])
    near = grid.whole & (reach < _NEAR_M) & (grid.spread < _SPREAD_M)
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


def _largest_piece(grid: _Grid, plane: np.ndarray) -> np.ndarray:
    """Cells of the largest connected piece, (m,) bool."""
    reach = np.hypot(grid.xyz[:, 0], grid.xyz[:, 1])
    height = grid.xyz[:, 2] - plane[0] - grid.xyz[:, :2] @ plane[1:]
    good = grid.whole & (grid.spread < _SPREAD_M + _SPREAD_PER_M * reach) & (np.abs(height) < _LEVEL_M)
    shape = (-1, grid.sectors)
    good, height, reach = good.reshape(shape), height.reshape(shape), reach.reshape(shape)
    number = np.arange(good.size).reshape(shape)
    ends: list[tuple[np.ndarray, np.ndarray]] = []
    stands = np.zeros_like(good)
    for step in (1, 2):  # the second passes over a laser that is lost or off
        near, far = (slice(step, None), slice(None, -step)) if len(good) > step else (slice(0, 0), slice(0, 0))
        gap = reach[far] - reach[near]  # rings come from the top: the next is nearer
        along = good[far] & good[near] & (gap > -0.05) & (gap < step * (0.3 + 0.012 * reach[far] ** 2))
        along &= np.abs(height[far] - height[near]) < np.clip(_ALONG_STEP_M + _ALONG_SLOPE * gap, 0, _HIGHEST_STEP_M)
        if step == 2:
            along &= ~stands[1:-1]
        stands[far] |= along
        stands[near] |= along
        ends.append((number[far][along], number[near][along]))
    # Along a kerb's face one ring climbs evenly, but the rings above and below it stand steeply over each other.
    good &= stands
    beside = [np.roll(array, -1, axis=1) for array in (good, height, reach, number)]
    across = good & beside[0] & (np.abs(height - beside[1]) < _ACROSS_STEP_M)
    across &= np.abs(reach - beside[2]) < 0.3 + 0.15 * reach
    ends.append((number[across], beside[3][across]))
    one, other = (np.concatenate(side) for side in zip(*ends, strict=True))
    links = coo_matrix((np.ones(len(one), bool), (one, other)), shape=(good.size, good.size))
    piece = connected_components(links, directed=False)[1]
    flat = good.reshape(-1)
    sizes = np.bincount(piece[flat], minlength=1)
    return flat & (piece == sizes.argmax())


def _ring_gap(grid: _Grid, rings: int) -> np.ndarray:
    """Distance from each cell to the ring below it, (m,); of the typical ring where that one has no cell."""
    reach = np.hypot(grid.xyz[:, 0], grid.xyz[:, 1]).reshape(rings, grid.sectors)
    below = np.vstack([reach[1:], np.full((1, grid.sectors), np.nan)])
    return np.nan_to_num((reach - below).reshape(-1), nan=0.05)
