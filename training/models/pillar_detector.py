"""PointPillars, as published and smaller: pillars, convolutions from above, anchors.

With `name: pointpillars` the parameters are those of OpenPCDet's, by name and shape.
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
from training.models.pillar_encoder import PillarEncoder, spread_on_grid
from training.models.settings import ModelSettings

_OVERLAP, _BEFORE, _AFTER = 0.01, 500, 100


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

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        """Class, box and direction."""
        return self.dense_head.losses(self._answers(batch), batch)

    def find(self, batch: Batch, least_score: float) -> list[tuple[Tensor, Tensor, Tensor]]:
        """Boxes (k, 7), scores (k,) and class indices (k,) of each frame."""
        output = self._answers(batch)
        limits = {"least_score": least_score, "overlap": _OVERLAP, "before": _BEFORE, "after": _AFTER}
        return [detect_from_anchors(self.dense_head, output, frame, **limits) for frame in range(len(batch))]

    def _answers(self, batch: Batch) -> AnchorOutput:
        settings = self.settings
        voxels = voxelise(batch.points, settings.grid, settings.max_points, settings.most_cells(self.training))
        with torch.autocast(batch.points.device.type, enabled=False):
            pillars = self.vfe(voxels)
        image = spread_on_grid(pillars, voxels, settings.grid, len(batch))
        return self.dense_head(self.backbone_2d(image))
