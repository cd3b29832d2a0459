"""Second stage of Voxel R-CNN: predict the overlap of each region as its score, and refine its box.

Names of parameters as in OpenPCDet's `VoxelRCNNHead`.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from training.models.roi_pool import VoxelPool, grid_points
from training.models.settings import ModelSettings
from training.models.sparse_conv import SparseTensor

_RADII_M = (0.4, 0.8, 1.6)
_STRIDES = (2, 4, 8)
_POINT_WIDTH = 32


class RoiHead(nn.Module):
    """Scores (n,) and residuals (n, 7) of regions."""

    def __init__(self, settings: ModelSettings, stage_channels: Sequence[int]) -> None:
        super().__init__()
        self._size = settings.roi_grid
        self.roi_grid_pool_layers = nn.ModuleList(
            VoxelPool(channels, stride, settings.grid, radius, settings.roi_neighbours)
            for channels, stride, radius in zip(stage_channels, _STRIDES, _RADII_M, strict=True)
        )
        width, drop = settings.roi_channels, settings.dropout
        pooled = _POINT_WIDTH * len(_STRIDES) * self._size**3
        self.shared_fc_layer = _dense(pooled, width, drop)
        self.cls_fc_layers = _dense(width, width, drop)
        self.cls_pred_layer = nn.Linear(width, 1)
        self.reg_fc_layers = _dense(width, width, drop)
        self.reg_pred_layer = nn.Linear(width, 7)
        nn.init.normal_(self.reg_pred_layer.weight, std=0.001)
        nn.init.zeros_(self.reg_pred_layer.bias)

    def forward(self, stages: Sequence[SparseTensor], rois: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (n,) and residuals (n, 7) of regions (n, 7) in frames (n,)."""
        points = grid_points(rois, self._size)
        frames = frame[:, None].expand(points.shape[:2]).reshape(-1)
        features = torch.cat(
            [pool(s, points.reshape(-1, 3), frames) for pool, s in zip(self.roi_grid_pool_layers, stages, strict=True)],
            1,
        )
        shared = self.shared_fc_layer(features.reshape(len(rois), -1))
        scores = self.cls_pred_layer(self.cls_fc_layers(shared))[:, 0]
        return scores, self.reg_pred_layer(self.reg_fc_layers(shared))


def _dense(channels_in: int, width: int, drop: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(channels_in, width, bias=False),
        nn.BatchNorm1d(width),
        nn.ReLU(),
        nn.Dropout(drop),
        nn.Linear(width, width, bias=False),
        nn.BatchNorm1d(width),
        nn.ReLU(),
    )
