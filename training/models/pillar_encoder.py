"""Encode the points of a pillar as one feature vector: PointPillars' feature net (Lang et al., CVPR 2019, section 2.1).

Parameters are named as in OpenPCDet: `pfn_layers.0.linear`, `pfn_layers.0.norm`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.data.grid import Grid
from training.data.voxels import Voxels

FEATURES = 10  # x y z intensity, offset from the pillar's points' mean, offset from its middle


class _PointNet(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.linear = nn.Linear(FEATURES, channels, bias=False)
        self.norm = nn.BatchNorm1d(channels, eps=1e-3, momentum=0.01)


class PillarEncoder(nn.Module):
    """Features of pillars.

    Args:
        grid: grid of the pillars.
        channels: number of features.
        padded_to: number of points to which pillars are padded with zeros that take part in the maximum, as in the
            published net; None: no padding.
    """

    def __init__(self, grid: Grid, channels: int, padded_to: int | None) -> None:
        super().__init__()
        self._grid, self._padded_to = grid, padded_to
        self.pfn_layers = nn.ModuleList([_PointNet(channels)])
        self.channels = channels

    def forward(self, voxels: Voxels) -> Tensor:
        """Features (v, channels) of v pillars."""
        layer = self.pfn_layers[0]
        features = self._features(voxels)
        if self._padded_to is not None:
            features = torch.cat([features, features.new_zeros(1, FEATURES)])
        values = functional.relu(layer.norm(layer.linear(features)))  # type: ignore[operator]
        points = values if self._padded_to is None else values[:-1]
        pillars = points.new_zeros(len(voxels.coordinates), self.channels)
        pillars = pillars.scatter_reduce(0, voxels.cell[:, None].expand_as(points), points, "amax")
        if self._padded_to is not None:
            short = (voxels.count < self._padded_to)[:, None]
            pillars = torch.where(short, torch.maximum(pillars, values[-1:]), pillars)
        return pillars

    def _features(self, voxels: Voxels) -> Tensor:
        xyz = voxels.points[:, 1:4]
        low, size = xyz.new_tensor(self._grid.low), xyz.new_tensor(self._grid.size)
        middle = (voxels.coordinates[:, [3, 2, 1]].to(xyz.dtype) + 0.5) * size + low
        return torch.cat([voxels.points[:, 1:], xyz - voxels.mean(xyz)[voxels.cell], xyz - middle[voxels.cell]], 1)


def spread_on_grid(features: Tensor, voxels: Voxels, grid: Grid, frames: int) -> Tensor:
    """Features (v, c) of pillars as an image (frames, c, ny, nx), zero for empty cells."""
    nx, ny, _ = grid.cells
    canvas = features.new_zeros(frames * ny * nx, features.shape[1])
    flat = (voxels.coordinates[:, 0] * ny + voxels.coordinates[:, 2]) * nx + voxels.coordinates[:, 3]
    canvas = canvas.index_copy(0, flat, features)
    return canvas.reshape(frames, ny, nx, -1).permute(0, 3, 1, 2)
