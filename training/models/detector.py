"""What every detector offers: losses in training, boxes otherwise."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from training.data.batch import Batch
from training.models.anchor_head import AnchorHead, AnchorOutput
from training.models.nms import Detections, suppress


class Detector(nn.Module):
    """Base of the detectors. Calling one gives its losses, weighted, by name."""

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        """Weighted losses by name; their sum is what training lowers."""
        raise NotImplementedError

    def detect(self, batch: Batch, least_score: float = 0.1) -> list[Detections]:
        """What is found in each frame. Put the detector into `eval()` before."""
        raise NotImplementedError

    def forward(self, batch: Batch) -> dict[str, Tensor]:
        """The losses, so that wrappers for several processes see the call."""
        return self.losses(batch)


def detect_from_anchors(
    head: AnchorHead, output: AnchorOutput, frame: int, *, least_score: float, overlap: float, before: int, after: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Boxes (k, 7), scores (k,) and class indices (k,) of a frame after suppression across classes."""
    scores, kinds = torch.sigmoid(output.scores[frame]).max(-1)
    rows = torch.nonzero(scores >= least_score)[:, 0]
    if len(rows) > before:
        rows = rows[torch.topk(scores[rows], before).indices]
    boxes = head.boxes(output, frame, rows)
    kept = suppress(boxes, scores[rows], overlap, before=before, after=after)
    return boxes[kept], scores[rows][kept], kinds[rows][kept]


def as_detections(boxes: Tensor, scores: Tensor, kinds: Tensor) -> Detections:
    """Tensors on any device as arrays."""
    arrays: list[Any] = [tensor.detach().float().cpu().numpy() for tensor in (boxes, scores)]
    return Detections(arrays[0], arrays[1], kinds.detach().cpu().numpy())
