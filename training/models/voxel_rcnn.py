"""Voxel R-CNN: sparse 3-D convolutions, bird's-eye proposals, and a second stage for each of them."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from training.data.batch import Batch
from training.data.voxels import voxelise
from training.models.anchor_head import AnchorHead, AnchorOutput
from training.models.bev_backbone import BevBackbone
from training.models.detector import Detector, detect_from_anchors
from training.models.nms import suppress
from training.models.regions import refine, regions_to_learn, roi_losses
from training.models.roi_head import RoiHead
from training.models.settings import ModelSettings
from training.models.sparse_conv import SparseTensor
from training.models.voxel_backbone import VoxelBackbone

_TRAIN_OVERLAP, _TEST_OVERLAP = 0.8, 0.7  # NMS overlap of proposals, in training and in tests
_CANDIDATES, _PROPOSALS, _TEST_COUNT = 8, 4, 100  # multiples of `roi_count`
_OVERLAP, _AFTER = 0.1, 100


class VoxelRcnn(Detector):
    """The detector of the paper."""

    def __init__(self, settings: ModelSettings, classes: Sequence[str]) -> None:
        super().__init__()
        self.settings = settings
        grid = settings.grid
        self.backbone_3d = VoxelBackbone(settings.sparse_channels, grid.cells)
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
        self.roi_head = RoiHead(settings, self.backbone_3d.stage_channels)
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
