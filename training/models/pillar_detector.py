"""PointPillars, as published and smaller: pillars, 2-D convolutions, anchors, and an optional second stage.

With `name: pointpillars` the parameters have the names and shapes of OpenPCDet's.
"""

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
from training.models.pillar_encoder import PillarEncoder, spread_on_grid
from training.models.point_refiner import PointRefiner
from training.models.regions import refine, regions_to_learn, roi_losses
from training.models.settings import ModelSettings

#: Prefix of the parameter names of the second stage.
SECOND_STAGE = "refiner."
_OVERLAP, _BEFORE, _AFTER = 0.01, 500, 100
_PROPOSED_OVERLAP, _PROPOSED = 0.7, 60  # proposals of the second stage
_COPIES = 4  # jittered copies of each true box in training


class PillarDetector(Detector):
    """A detector on pillars."""

    def __init__(self, settings: ModelSettings, classes: Sequence[str]) -> None:
        super().__init__()
        self.settings = settings
        grid = settings.grid
        self.vfe = PillarEncoder(grid, settings.pillar_channels, settings.max_points)
        self.backbone_2d = BevBackbone(
            settings.pillar_channels,
            settings.layers,
            settings.strides,
            settings.channels,
            settings.upsample,
            settings.upsample_channels,
        )
        self.dense_head = AnchorHead(
            self.backbone_2d.channels, classes, grid, settings.out_stride, settings.direction_offset_rad
        )
        if settings.refine:
            self.refiner = PointRefiner(settings.roi_channels, settings.roi_points, settings.dropout)
        self._generator = torch.Generator()

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        """Losses of class, box and direction, and of the second stage."""
        output = self._run_first_stage(batch)
        losses = self.dense_head.losses(output, batch)
        return {**losses, **self._refiner_losses(output, batch)} if self.settings.refine else losses

    def find(self, batch: Batch, least_score: float) -> list[tuple[Tensor, Tensor, Tensor]]:
        """Boxes (k, 7), scores (k,) and class indices (k,) of each frame."""
        output = self._run_first_stage(batch)
        if self.settings.refine:
            return [self._refine_frame(output, batch, frame, least_score) for frame in range(len(batch))]
        limits = {"least_score": least_score, "overlap": _OVERLAP, "before": _BEFORE, "after": _AFTER}
        return [detect_from_anchors(self.dense_head, output, frame, **limits) for frame in range(len(batch))]

    def _refiner_losses(self, output: AnchorOutput, batch: Batch) -> dict[str, Tensor]:
        self._generator.manual_seed(int(torch.randint(2**31, (1,))))
        regions = regions_to_learn(
            batch,
            lambda frame: self._proposals(output, frame, 0.0)[0],
            self.settings.roi_count,
            _COPIES,
            self._generator,
        )
        with torch.autocast(batch.points.device.type, enabled=False):
            scores, residuals = self.refiner(batch.points, regions.boxes, regions.frame)
            return roi_losses(scores, residuals, regions.boxes, regions.objects, regions.overlap)

    def _refine_frame(
        self, output: AnchorOutput, batch: Batch, frame: int, least_score: float
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Boxes, scores and classes of a frame after the second look."""
        proposed, first, class_ids = self._proposals(output, frame, least_score)
        with torch.autocast(batch.points.device.type, enabled=False):
            number = torch.full((len(proposed),), frame, device=proposed.device)
            logits, residuals = self.refiner(batch.points, proposed, number)
        boxes, scores = refine(proposed, residuals), (torch.sigmoid(logits) * first).sqrt()
        rows = torch.nonzero(scores >= least_score)[:, 0]
        kept = rows[suppress(boxes[rows], scores[rows], _OVERLAP, before=_BEFORE, after=_AFTER)]
        return boxes[kept], scores[kept], class_ids[kept]

    def _proposals(self, output: AnchorOutput, frame: int, least_score: float) -> tuple[Tensor, Tensor, Tensor]:
        """Boxes, scores and classes that the first stage proposes."""
        limits = {"overlap": _PROPOSED_OVERLAP, "before": _BEFORE, "after": _PROPOSED}
        return detect_from_anchors(self.dense_head, output, frame, least_score=least_score, **limits)

    def _run_first_stage(self, batch: Batch) -> AnchorOutput:
        settings = self.settings
        voxels = voxelise(batch.points, settings.grid, settings.max_points, settings.most_cells(self.training))
        with torch.autocast(batch.points.device.type, enabled=False):
            pillars = self.vfe(voxels)
        image = spread_on_grid(pillars, voxels, settings.grid, len(batch))
        return self.dense_head(self.backbone_2d(image))
