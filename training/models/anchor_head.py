"""Scores, boxes and directions of anchors. Parameters as in OpenPCDet: `conv_cls`, `conv_box`, `conv_dir_cls`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.data.batch import Batch
from training.data.grid import Grid
from training.models.anchors import HEADINGS_RAD, anchor_classes, make_anchors
from training.models.assigning import assign
from training.models.coding import DIRECTIONS, decode, with_direction
from training.models.losses import anchor_losses

_PRIOR = 0.01  # initial object probability of an anchor


@dataclass(frozen=True, eq=False)
class AnchorOutput:
    """Outputs of all anchors: scores (b, a, classes) [logits], residuals (b, a, 7), directions (b, a, 2) [logits]."""

    scores: Tensor
    residuals: Tensor
    directions: Tensor


class AnchorHead(nn.Module):
    """One 1 × 1 convolution for each output."""

    anchors: Tensor

    def __init__(self, channels: int, classes: Sequence[str], grid: Grid, stride: int, direction_offset: float) -> None:
        super().__init__()
        self._classes = anchor_classes(classes)
        each = len(classes) * len(HEADINGS_RAD)
        self._count, self._direction_offset = len(classes), direction_offset
        self.conv_cls = nn.Conv2d(channels, each * len(classes), 1)
        self.conv_box = nn.Conv2d(channels, each * 7, 1)
        self.conv_dir_cls = nn.Conv2d(channels, each * DIRECTIONS, 1)
        self.register_buffer("anchors", make_anchors(self._classes, grid, stride), persistent=False)
        nn.init.constant_(self.conv_cls.bias, -math.log((1 - _PRIOR) / _PRIOR))  # type: ignore[arg-type]
        nn.init.normal_(self.conv_box.weight, std=0.001)

    def forward(self, image: Tensor) -> AnchorOutput:
        """Compute the outputs at every cell of an image (b, c, rows, columns)."""
        cells = image.permute(0, 2, 3, 1).flatten(0, 2)
        convolutions = (self.conv_cls, self.conv_box, self.conv_dir_cls)
        with torch.autocast(image.device.type, enabled=False):  # boxes need millimetre precision
            weight = torch.cat([conv.weight.flatten(1) for conv in convolutions])
            bias = torch.cat([conv.bias for conv in convolutions])  # type: ignore[misc]
            answers = functional.linear(cells.float(), weight, bias)  # one product is faster than three convolutions
        parts = answers.split([conv.out_channels for conv in convolutions], dim=1)
        widths = (self._count, 7, DIRECTIONS)
        return AnchorOutput(*(p.reshape(len(image), -1, width) for p, width in zip(parts, widths, strict=True)))

    def losses(self, output: AnchorOutput, batch: Batch) -> dict[str, Tensor]:
        """Weighted losses by name."""
        targets = assign(self.anchors, self._classes, batch.boxes, batch.class_ids)
        return anchor_losses(output.scores, output.residuals, output.directions, targets, self._direction_offset)

    def boxes(self, output: AnchorOutput, frame: int, rows: Tensor) -> Tensor:
        """Decode the boxes (n, 7) of selected anchors of a frame."""
        decoded = decode(output.residuals[frame, rows], self.anchors.reshape(-1, 7)[rows])
        yaw = with_direction(decoded[:, 6], output.directions[frame, rows].argmax(-1), self._direction_offset)
        return torch.cat([decoded[:, :6], yaw[:, None]], 1)
