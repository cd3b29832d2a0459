"""Voxel RoI pooling: a grid of points in each region gathers the voxels around it.

Deng et al., "Voxel R-CNN: Towards High Performance Voxel-based 3D Object Detection", AAAI 2021, section 3.2. Names of
parameters as in OpenPCDet's `NeighborVoxelSAModuleMSG`.
"""

from __future__ import annotations

import itertools

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.data.grid import Grid
from training.models.sparse_conv import SparseTensor, cell_keys, find_cells

_NEIGHBOURS = 16  # maximum number of voxels per point
_CHUNK = 4096  # points per lookup
_WIDTH = 32


def grid_points(rois: Tensor, size: int) -> Tensor:
    """Points (n, size³, 3) evenly spread in regions (n, 7)."""
    steps = (torch.arange(size, device=rois.device, dtype=rois.dtype) + 0.5) / size - 0.5
    local = torch.stack(torch.meshgrid(steps, steps, steps, indexing="ij"), -1).reshape(1, -1, 3) * rois[:, None, 3:6]
    cos, sin = torch.cos(rois[:, None, 6]), torch.sin(rois[:, None, 6])
    x, y = cos * local[..., 0] - sin * local[..., 1], sin * local[..., 0] + cos * local[..., 1]
    return torch.stack([x, y, local[..., 2]], -1) + rois[:, None, :3]


class VoxelPool(nn.Module):
    """Features of points from the voxels of one stage.

    Args:
        channels: channels of the stage.
        stride: stride of the stage, in cells of the grid.
        grid: grid of the finest cells.
        radius_m: maximum distance of voxel centres.
        reach: search radius in voxels per axis.
    """

    def __init__(self, channels: int, stride: int, grid: Grid, radius_m: float, reach: int) -> None:
        super().__init__()
        self._stride, self._grid, self._radius = stride, grid, radius_m
        around = range(-reach, reach + 1)
        size = (grid.size[2], grid.size[1], grid.size[0])
        offsets = sorted(
            itertools.product(around, around, around),
            key=lambda offset: sum((o * s) ** 2 for o, s in zip(offset, size, strict=True)),
        )
        near = [
            offset
            for offset in offsets
            if sum((max(abs(o) - 1, 0) * s * stride) ** 2 for o, s in zip(offset, size, strict=True)) <= radius_m**2
        ]
        self.register_buffer("_offsets", torch.tensor(near), persistent=False)
        self.mlps_in = nn.ModuleList(
            [nn.Sequential(nn.Conv1d(channels, _WIDTH, 1, bias=False), nn.BatchNorm1d(_WIDTH))]
        )
        self.mlps_pos = nn.ModuleList([nn.Sequential(nn.Conv2d(3, _WIDTH, 1, bias=False), nn.BatchNorm2d(_WIDTH))])
        self.mlps_out = nn.ModuleList(
            [nn.Sequential(nn.Conv1d(_WIDTH, _WIDTH, 1, bias=False), nn.BatchNorm1d(_WIDTH), nn.ReLU())]
        )

    def forward(self, tensor: SparseTensor, points: Tensor, frame: Tensor) -> Tensor:
        """Features (p, 32) of points (p, 3) [m] in frames (p,)."""
        rows, exists, offset = self._gather(tensor, points, frame)
        inner = self.mlps_in[0](tensor.features.T[None])[0].T
        position = self.mlps_pos[0](offset.permute(2, 0, 1)[None])[0].permute(1, 2, 0)
        values = functional.relu(inner[rows] + position) * exists[..., None]
        return self.mlps_out[0](values.amax(1).T[None])[0].T

    @torch.no_grad()
    def _gather(self, tensor: SparseTensor, points: Tensor, frame: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Up to 16 voxels per point: rows (p, 16), whether each exists, and their offsets [m]."""
        keys = tensor.keys
        parts = [
            self._near(tensor, keys, points[start : start + _CHUNK], frame[start : start + _CHUNK])
            for start in range(0, len(points), _CHUNK)
        ]
        rows, exists = (torch.cat([part[i] for part in parts]) for i in range(2))
        offset = torch.where(exists[..., None], self._middles(tensor)[rows] - points[:, None], 0.0)
        return rows, exists, offset

    def _near(self, tensor: SparseTensor, keys: Tensor, points: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        cell = torch.floor((points - points.new_tensor(self._grid.low)) / self._cell(points)).long()[:, [2, 1, 0]]
        coordinates = cell[:, None] + self._offsets  # type: ignore[operator]
        limits = torch.tensor(tensor.shape, device=points.device)
        inside = ((coordinates >= 0) & (coordinates < limits)).all(-1)
        flat = torch.cat([frame[:, None, None].expand(*coordinates.shape[:2], 1), coordinates], -1)
        wanted = cell_keys(flat.reshape(-1, 4), tensor.shape).reshape(inside.shape)
        rows, exists = find_cells(keys, wanted)
        distance = (self._middles(tensor)[rows] - points[:, None]).square().sum(-1)
        exists = exists & inside & (distance <= self._radius**2)
        most = min(_NEIGHBOURS, exists.shape[1])
        rank = torch.arange(exists.shape[1], 0, -1, device=points.device) * exists
        best = torch.topk(rank, most, dim=1).indices
        return torch.gather(rows, 1, best), torch.gather(exists, 1, best)

    def _middles(self, tensor: SparseTensor) -> Tensor:
        cell = self._cell(tensor.features)
        return (tensor.coordinates[:, [3, 2, 1]].to(cell.dtype) + 0.5) * cell + cell.new_tensor(self._grid.low)

    def _cell(self, like: Tensor) -> Tensor:
        return torch.tensor(self._grid.size, device=like.device) * self._stride
