"""Voxel R-CNN: sparse 3-D convolutions, bird's-eye proposals, and a second stage for each of them.

The sparse stages are those of SECOND, too: 8 × coarser, then flattened to the bird's-eye view. The second stage
predicts the overlap of each region as its score, and refines its box. Parameters are named as in OpenPCDet's
`VoxelBackBone8x` and `VoxelRCNNHead`.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from training.data.batch import Batch
from training.data.voxels import voxelise
from training.models.anchor_head import AnchorHead, AnchorOutput
from training.models.bev_backbone import BevBackbone
from training.models.detector import Detector, detect_from_anchors
from training.models.nms import suppress
from training.models.regions import refine, regions_to_learn, roi_losses
from training.models.roi_pool import VoxelPool, grid_points
from training.models.settings import ModelSettings
from training.models.sparse_conv import SparseSequential, SparseTensor, StridedConv, SubmanifoldConv, Triple

_TRAIN_OVERLAP, _TEST_OVERLAP = 0.8, 0.7  # NMS overlap of proposals, in training and in tests
_CANDIDATES, _PROPOSALS, _TEST_COUNT = 8, 4, 100  # multiples of `roi_count`
_OVERLAP, _AFTER = 0.1, 100
_POOL_RADII_M = (0.4, 0.8, 1.6)
_POOL_STRIDES = (2, 4, 8)
_POINT_WIDTH = 32
_CUBE: Triple = (3, 3, 3)


class VoxelRcnn(Detector):
    """The detector of the paper."""

    def __init__(self, settings: ModelSettings, classes: Sequence[str]) -> None:
        super().__init__()
        self.settings = settings
        grid = settings.grid
        self.backbone_3d = _VoxelBackbone(settings.sparse_channels, grid.cells)
        self.backbone_2d = BevBackbone(
            self.backbone_3d.channels,
            settings.layers,
            settings.strides,
            settings.channels,
            settings.upsample,
            settings.upsample_channels,
        )
        stride = settings.sparse_stride * settings.out_stride
        self.dense_head = AnchorHead(self.backbone_2d.channels, classes, grid, stride, settings.direction_offset_rad)
        self.roi_head = _RoiHead(settings, self.backbone_3d.stage_channels)
        self._generator = torch.Generator()

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        """Losses of the proposals and of the second stage."""
        output, stages = self._propose(batch)
        losses = self.dense_head.losses(output, batch)
        self._generator.manual_seed(int(torch.randint(2**31, (1,))))
        regions = regions_to_learn(
            batch, lambda frame: self._proposals(output, frame)[0], self.settings.roi_count, 0, self._generator
        )
        with torch.autocast(batch.points.device.type, enabled=False):
            scores, residuals = self.roi_head(stages, regions.boxes, regions.frame)
            second = roi_losses(scores, residuals, regions.boxes, regions.objects, regions.overlap)
        return {**losses, **second}

    def find(self, batch: Batch, least_score: float) -> list[tuple[Tensor, Tensor, Tensor]]:
        """Boxes (k, 7), scores (k,) and class indices (k,) of each frame."""
        output, stages = self._propose(batch)
        detections = []
        for frame in range(len(batch)):
            rois, _, class_ids = self._proposals(output, frame)
            with torch.autocast(batch.points.device.type, enabled=False):
                logits, residuals = self.roi_head(stages, rois, torch.full((len(rois),), frame, device=rois.device))
            scores, boxes = torch.sigmoid(logits), refine(rois, residuals)
            rows = torch.nonzero(scores >= least_score)[:, 0]
            kept = rows[suppress(boxes[rows], scores[rows], _OVERLAP, before=len(rows), after=_AFTER)]
            detections.append((boxes[kept], scores[kept], class_ids[kept]))
        return detections

    def _proposals(self, output: AnchorOutput, frame: int) -> tuple[Tensor, Tensor, Tensor]:
        """Boxes, scores and classes of the anchors with the highest scores."""
        count = _PROPOSALS * self.settings.roi_count if self.training else _TEST_COUNT
        overlap = _TRAIN_OVERLAP if self.training else _TEST_OVERLAP
        before = _CANDIDATES * self.settings.roi_count
        return detect_from_anchors(
            self.dense_head, output, frame, least_score=0.0, overlap=overlap, before=before, after=count
        )

    def _propose(self, batch: Batch) -> tuple[AnchorOutput, list[SparseTensor]]:
        settings = self.settings
        voxels = voxelise(batch.points, settings.grid, settings.max_points, settings.most_cells(self.training))
        with torch.autocast(batch.points.device.type, enabled=False):
            features = voxels.mean(voxels.points[:, 1:])
            image, stages = self.backbone_3d(features, voxels.coordinates, len(batch))
        return self.dense_head(self.backbone_2d(image)), stages


class _RoiHead(nn.Module):
    """Scores (n,) and residuals (n, 7) of regions."""

    def __init__(self, settings: ModelSettings, stage_channels: Sequence[int]) -> None:
        super().__init__()
        self._size = settings.roi_grid
        self.roi_grid_pool_layers = nn.ModuleList(
            VoxelPool(channels, stride, settings.grid, radius, settings.roi_neighbours)
            for channels, stride, radius in zip(stage_channels, _POOL_STRIDES, _POOL_RADII_M, strict=True)
        )
        width, drop = settings.roi_channels, settings.dropout
        pooled = _POINT_WIDTH * len(_POOL_STRIDES) * self._size**3
        self.shared_fc_layer = _dense_layers(pooled, width, drop)
        self.cls_fc_layers = _dense_layers(width, width, drop)
        self.cls_pred_layer = nn.Linear(width, 1)
        self.reg_fc_layers = _dense_layers(width, width, drop)
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


def _dense_layers(channels_in: int, width: int, drop: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(channels_in, width, bias=False),
        nn.BatchNorm1d(width),
        nn.ReLU(),
        nn.Dropout(drop),
        nn.Linear(width, width, bias=False),
        nn.BatchNorm1d(width),
        nn.ReLU(),
    )


class _VoxelBackbone(nn.Module):
    """Four stages of sparse convolutions, and one that halves the height.

    Args:
        channels: channels of the first stage, the three coarser ones, and the last.
        cells: numbers of cells along x, y, z.
    """

    def __init__(self, channels: tuple[int, int, int, int, int], cells: Triple) -> None:
        super().__init__()
        a, b, c, d, e = channels
        self.shape: Triple = (cells[2] + 1, cells[1], cells[0])
        self.conv_input = _submanifold_block(4, a)
        self.conv1 = SparseSequential(_submanifold_block(a, a))
        self.conv2 = SparseSequential(_strided_block(a, b), _submanifold_block(b, b), _submanifold_block(b, b))
        self.conv3 = SparseSequential(_strided_block(b, c), _submanifold_block(c, c), _submanifold_block(c, c))
        self.conv4 = SparseSequential(
            _strided_block(c, d, (0, 1, 1)), _submanifold_block(d, d), _submanifold_block(d, d)
        )
        self.conv_out = SparseSequential(StridedConv(d, e, (3, 1, 1), (2, 1, 1), (0, 0, 0)), _norm(e), nn.ReLU())
        height = self.shape[0]
        for padding in (1, 1, 0):
            height = (height + 2 * padding - 3) // 2 + 1
        self.channels = e * ((height - 3) // 2 + 1)
        self.stage_channels = (b, c, d)

    def forward(self, features: Tensor, coordinates: Tensor, frames: int) -> tuple[Tensor, list[SparseTensor]]:
        """Bird's-eye features (frames, channels, y / 8, x / 8), and the stages 2, 4 and 8 × coarser."""
        first = self.conv1(self.conv_input(SparseTensor(features, coordinates, self.shape, frames)))
        second = self.conv2(first)
        third = self.conv3(second)
        fourth = self.conv4(third)
        dense = self.conv_out(fourth).dense()
        return torch.flatten(dense, 1, 2), [second, third, fourth]


def _submanifold_block(channels_in: int, channels: int) -> SparseSequential:
    return SparseSequential(SubmanifoldConv(channels_in, channels, _CUBE), _norm(channels), nn.ReLU())


def _strided_block(channels_in: int, channels: int, padding: Triple = (1, 1, 1)) -> SparseSequential:
    return SparseSequential(StridedConv(channels_in, channels, _CUBE, (2, 2, 2), padding), _norm(channels), nn.ReLU())


def _norm(channels: int) -> nn.BatchNorm1d:
    return nn.BatchNorm1d(channels, eps=1e-3, momentum=0.01)
