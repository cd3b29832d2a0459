"""Scores, boxes and directions of anchors, and their losses.

Parameters as in OpenPCDet: `conv_cls`, `conv_box`, `conv_dir_cls`. Losses: focal,
smooth L1 with the sine of the heading, direction (SECOND, sections 3.1.3–3.3).
"""

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
from training.models.assigning import Targets, assign
from training.models.coding import DIRECTIONS, decode, direction_of, with_direction

_PRIOR = 0.01  # initial object probability of an anchor
_FOCAL_ALPHA, _FOCAL_GAMMA = 0.25, 2.0
_L1_BETA = 1.0 / 9.0
_LOSS_WEIGHTS = {"class": 1.0, "box": 2.0, "direction": 0.2}


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
        return _anchor_losses(output.scores, output.residuals, output.directions, targets, self._direction_offset)

    def boxes(self, output: AnchorOutput, frame: int, rows: Tensor) -> Tensor:
        """Decode the boxes (n, 7) of selected anchors of a frame."""
        decoded = decode(output.residuals[frame, rows], self.anchors.reshape(-1, 7)[rows])
        yaw = with_direction(decoded[:, 6], output.directions[frame, rows].argmax(-1), self._direction_offset)
        return torch.cat([decoded[:, :6], yaw[:, None]], 1)


def _anchor_losses(
    scores: Tensor, residuals: Tensor, directions: Tensor, targets: Targets, direction_offset: float
) -> dict[str, Tensor]:
    """Weighted losses by name.

    Args:
        scores: (b, a, classes) logits.
        residuals: (b, a, 7).
        directions: (b, a, 2) logits.
        targets: targets of the anchors.
        direction_offset: heading at which the first half-turn starts [rad].
    """
    label = targets.label
    positive = label > 0
    positives = positive.sum(1).clamp(min=1).to(scores.dtype)[:, None]
    one_hot = functional.one_hot(label.clamp(min=0), scores.shape[-1] + 1)[..., 1:].to(scores.dtype)
    focal = _focal(scores, one_hot) * (label >= 0)[..., None]
    weight = (1 / positives).expand_as(label)[positive]
    frames = len(label)
    box = _box_loss(residuals[positive], targets.residual[positive], weight)
    turn = functional.cross_entropy(
        directions[positive], direction_of(targets.yaw[positive], direction_offset), reduction="none"
    )
    losses = {
        "class": (focal.sum(-1) / positives).sum() / frames,
        "box": box / frames,
        "direction": (turn * weight).sum() / frames,
    }
    return {name: _LOSS_WEIGHTS[name] * value for name, value in losses.items()}


def _sine_difference(residual: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
    """Replace the angles so that the difference of the last columns is the sine of the angle difference."""
    a, b = residual[:, 6:7], target[:, 6:7]
    return (
        torch.cat([residual[:, :6], torch.sin(a) * torch.cos(b)], 1),
        torch.cat([target[:, :6], torch.cos(a) * torch.sin(b)], 1),
    )


def _box_loss(residual: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    predicted, expected = _sine_difference(residual, target)
    return (functional.smooth_l1_loss(predicted, expected, beta=_L1_BETA, reduction="none").sum(1) * weight).sum()


def _focal(logits: Tensor, target: Tensor) -> Tensor:
    probability = torch.sigmoid(logits)
    alpha = target * _FOCAL_ALPHA + (1 - target) * (1 - _FOCAL_ALPHA)
    error = target * (1 - probability) + (1 - target) * probability
    plain = functional.binary_cross_entropy_with_logits(logits, target, reduction="none")
    return alpha * error**_FOCAL_GAMMA * plain
