"""Base class of detectors: losses in training, boxes otherwise."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from training.data.batch import Batch
from training.data.level_ground import find_ground
from training.models.anchor_head import AnchorHead, AnchorOutput
from training.models.nms import Detections, suppress
from training.models.settings import ModelSettings


class Detector(nn.Module):
    """Base of the detectors. Calling one returns its weighted losses by name, as DistributedDataParallel requires.

    Attributes:
        settings: architecture. With `level_ground` all frames are transformed to level ground; without `intensity`
            all intensities are set to zero.
    """

    settings: ModelSettings

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        """Weighted losses by name; their sum is minimised in training."""
        raise NotImplementedError

    def find(self, batch: Batch, least_score: float) -> list[tuple[Tensor, Tensor, Tensor]]:
        """Boxes (k, 7), scores (k,) and class indices (k,) of each frame."""
        raise NotImplementedError

    def forward(self, batch: Batch) -> dict[str, Tensor]:
        """The losses."""
        batch = self._select_inputs(batch)
        if self.settings.level_ground:
            batch = find_ground(batch.points, len(batch), self.settings.grid).levelled(batch)
        return self.losses(batch)

    @torch.no_grad()
    def detect(self, batch: Batch, least_score: float = 0.1) -> list[Detections]:
        """Detect objects in each frame. Call `eval()` before."""
        batch = self._select_inputs(batch)
        if not self.settings.level_ground:
            return [_as_arrays(*parts) for parts in self.find(batch, least_score)]
        ground = find_ground(batch.points, len(batch), self.settings.grid)
        found = self.find(ground.levelled(batch), least_score)
        return [_as_arrays(ground.raised(boxes, frame), *rest) for frame, (boxes, *rest) in enumerate(found)]

    def _select_inputs(self, batch: Batch) -> Batch:
        """Remove inputs that the detector does not use."""
        return batch if self.settings.intensity else batch.without_intensity()


def detect_from_anchors(
    head: AnchorHead, output: AnchorOutput, frame: int, *, least_score: float, overlap: float, before: int, after: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Boxes (k, 7), scores (k,) and class indices (k,) of a frame after non-maximum suppression across classes."""
    scores, class_ids = torch.sigmoid(output.scores[frame]).max(-1)
    rows = torch.nonzero(scores >= least_score)[:, 0]
    if len(rows) > before:
        rows = rows[torch.topk(scores[rows], before).indices]
    boxes = head.boxes(output, frame, rows)
    kept = suppress(boxes, scores[rows], overlap, before=before, after=after)
    return boxes[kept], scores[rows][kept], class_ids[rows][kept]


def _as_arrays(boxes: Tensor, scores: Tensor, class_ids: Tensor) -> Detections:
    """Convert tensors on any device to arrays."""
    arrays: list[Any] = [tensor.detach().float().cpu().numpy() for tensor in (boxes, scores)]
    return Detections(arrays[0], arrays[1], class_ids.detach().cpu().numpy())
