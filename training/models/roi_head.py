"""The second stage of Voxel R-CNN: looks into each region again, scores it by its overlap, and refines the box.

Names of parameters as in OpenPCDet's `VoxelRCNNHead`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from training.evaluation.rotated_overlap import paired_intersections
from training.models.coding import decode, encode, within_period
from training.models.roi_pool import VoxelPool, grid_points
from training.models.settings import ModelSettings
from training.models.sparse_conv import SparseTensor

_RADII_M = (0.4, 0.8, 1.6)
_STRIDES = (2, 4, 8)
_SURE, _UNSURE, _REFINED = 0.75, 0.25, 0.55
_SHARE_FOUND = 0.5
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


def overlap_3d(a: Tensor, b: Tensor) -> Tensor:
    """Intersection over union of all pairs of boxes (n, 7), (m, 7): (n, m) float32 on their device."""
    one, other = (t.detach().double().cpu().numpy() for t in (a, b))
    left, right = np.repeat(np.arange(len(one)), len(other)), np.tile(np.arange(len(other)), len(one))
    columns = [0, 1, 3, 4, 6]
    shared = paired_intersections(one[left][:, columns], other[right][:, columns])
    top = np.minimum(one[left, 2] + one[left, 5] / 2, other[right, 2] + other[right, 5] / 2)
    bottom = np.maximum(one[left, 2] - one[left, 5] / 2, other[right, 2] - other[right, 5] / 2)
    shared *= np.clip(top - bottom, 0, None)
    union = one[left, 3:6].prod(1) + other[right, 3:6].prod(1) - shared
    return torch.from_numpy((shared / np.maximum(union, 1e-9)).reshape(len(one), len(other))).to(a)


def choose_rois(rois: Tensor, objects: Tensor, count: int, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Regions to learn from: half of them on objects, if there are so many.

    Args:
        rois: (n, 7).
        objects: (m, 7).
        count: at most so many are chosen.
        generator: draws them; on the CPU.

    Returns:
        Chosen regions (k, 7), the object of each (k, 7), and the overlap with it (k,).
    """
    rois = torch.cat([rois, objects])
    if not len(objects):
        chosen = rois[:count]
        return chosen, chosen, chosen.new_zeros(len(chosen))
    overlap, which = overlap_3d(rois, objects).max(1)
    found = torch.nonzero(overlap >= _REFINED)[:, 0]
    rest = torch.nonzero(overlap < _REFINED)[:, 0]
    some = _draw(found, round(count * _SHARE_FOUND), generator)
    rows = torch.cat([some, _draw(rest, count - len(some), generator)])
    return rois[rows], objects[which[rows]], overlap[rows]


def roi_losses(scores: Tensor, residuals: Tensor, rois: Tensor, objects: Tensor, overlap: Tensor) -> dict[str, Tensor]:
    """Losses of regions: the score is to tell the overlap, the residuals and corners the object."""
    wanted = ((overlap - _UNSURE) / (_SURE - _UNSURE)).clamp(0, 1)
    losses = {"roi_class": functional.binary_cross_entropy_with_logits(scores, wanted)}
    rows = torch.nonzero(overlap >= _REFINED)[:, 0]
    count = max(len(rows), 1)
    local, anchor = _in_roi(objects[rows], rois[rows])
    target = encode(local, anchor)
    box = functional.smooth_l1_loss(residuals[rows], target, beta=1 / 9, reduction="sum") / count
    corners = _corners(decode(residuals[rows], anchor))
    turned = torch.cat([local[:, :6], local[:, 6:] + math.pi], 1)
    gap = torch.minimum((corners - _corners(local)).norm(dim=-1), (corners - _corners(turned)).norm(dim=-1))
    corner = torch.where(gap < 1, 0.5 * gap**2, gap - 0.5).mean(1).sum() / count
    return {**losses, "roi_box": box, "roi_corner": corner}


def refine(rois: Tensor, residuals: Tensor) -> Tensor:
    """Boxes (n, 7) of residuals given in the axes of regions (n, 7)."""
    local = decode(residuals, _anchor(rois))
    cos, sin = torch.cos(rois[:, 6]), torch.sin(rois[:, 6])
    x = cos * local[:, 0] - sin * local[:, 1] + rois[:, 0]
    y = sin * local[:, 0] + cos * local[:, 1] + rois[:, 1]
    return torch.stack([x, y, local[:, 2] + rois[:, 2], *local[:, 3:6].T, local[:, 6] + rois[:, 6]], 1)


def _in_roi(objects: Tensor, rois: Tensor) -> tuple[Tensor, Tensor]:
    """Objects in the axes of their regions, turned to the nearer end; and the regions in their own axes."""
    offset = objects[:, :3] - rois[:, :3]
    cos, sin = torch.cos(rois[:, 6]), torch.sin(rois[:, 6])
    x, y = cos * offset[:, 0] + sin * offset[:, 1], cos * offset[:, 1] - sin * offset[:, 0]
    yaw = within_period(objects[:, 6] - rois[:, 6], 0.5, math.pi)
    return torch.stack([x, y, offset[:, 2], *objects[:, 3:6].T, yaw], 1), _anchor(rois)


def _anchor(rois: Tensor) -> Tensor:
    return torch.cat([torch.zeros_like(rois[:, :3]), rois[:, 3:6], torch.zeros_like(rois[:, 6:])], 1)


def _corners(boxes: Tensor) -> Tensor:
    return grid_points(torch.cat([boxes[:, :3], 2 * boxes[:, 3:6], boxes[:, 6:]], 1), 2)


def _draw(rows: Tensor, count: int, generator: torch.Generator) -> Tensor:
    return rows[torch.randperm(len(rows), generator=generator)[:count].to(rows.device)]


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
