"""Voxelisation of points into voxels or pillars, in plain torch."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from training.data.grid import Grid


@dataclass(frozen=True, eq=False)
class Voxels:
    """Points grouped by cell.

    Attributes:
        points: (n, 5) points within the grid: index of the frame, x, y, z, intensity.
        cell: (n,) int64 row of `coordinates` of each point.
        place: (v, 4) int64 frame, z, y, x of the occupied cells, in that order.
    """

    points: Tensor
    cell: Tensor
    coordinates: Tensor

    def mean(self, values: Tensor) -> Tensor:
        """Mean of values (n, c) over the points of each cell, (v, c)."""
        total = values.new_zeros(len(self.coordinates), values.shape[1]).index_add_(0, self.cell, values)
        return total / self.count.clamp(min=1)[:, None].to(values.dtype)

    @property
    def count(self) -> Tensor:
        """(v,) int64 points in each cell."""
        return torch.bincount(self.cell, minlength=len(self.coordinates))


def voxelise(points: Tensor, grid: Grid, max_points: int | None = None, max_cells: int | None = None) -> Voxels:
    """Assign points to cells.

    Args:
        points: (n, 5) index of the frame, x, y, z [m], intensity.
        grid: the cells.
        max_points: maximum number of points per cell; the first ones are kept.
        max_cells: maximum number of cells per frame; those of the first points are kept.
    """
    low, size = points.new_tensor(grid.low), points.new_tensor(grid.size)
    cells = torch.tensor(grid.cells, device=points.device)
    coordinates = torch.floor((points[:, 1:4] - low) / size).long()
    inside = ((coordinates >= 0) & (coordinates < cells)).all(1)
    points, coordinates = points[inside], coordinates[inside]
    nx, ny, nz = grid.cells
    key = ((points[:, 0].long() * nz + coordinates[:, 2]) * ny + coordinates[:, 1]) * nx + coordinates[:, 0]
    keys, cell = torch.unique(key, return_inverse=True)
    if max_points is not None or max_cells is not None:
        kept = _limited(cell, keys // (nx * ny * nz), max_points, max_cells)
        points, (keys, cell) = points[kept], torch.unique(key[kept], return_inverse=True)
    x, rest = keys % nx, keys // nx
    y, rest = rest % ny, rest // ny
    return Voxels(points, cell, torch.stack([rest // nz, rest % nz, y, x], 1))


def _limited(cell: Tensor, frame_of_cell: Tensor, max_points: int | None, max_cells: int | None) -> Tensor:
    """Mask of points to keep, (n,) bool."""
    kept = torch.ones_like(cell, dtype=torch.bool)
    order = torch.argsort(cell, stable=True)
    counts = torch.bincount(cell, minlength=len(frame_of_cell))
    first = torch.cumsum(counts, 0) - counts
    if max_points is not None:
        rank = torch.empty_like(cell)
        rank[order] = torch.arange(len(cell), device=cell.device) - first[cell[order]]
        kept &= rank < max_points
    if max_cells is not None:
        appears = order[first]  # the first point of each cell, as the sort is stable
        by_frame = torch.argsort(appears, stable=True)
        by_frame = by_frame[torch.argsort(frame_of_cell[by_frame], stable=True)]
        per_frame = torch.bincount(frame_of_cell)
        start = torch.cumsum(per_frame, 0) - per_frame
        number = torch.arange(len(by_frame), device=cell.device) - start[frame_of_cell[by_frame]]
        few = torch.empty_like(frame_of_cell, dtype=torch.bool)
        few[by_frame] = number < max_cells
        kept &= few[cell]
    return kept
