"""Losses of anchor heads: focal, smooth L1 with the sine of the heading, direction (SECOND, sections 3.1.3–3.3)."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from training.models.assigning import Targets
from training.models.coding import direction_of

_ALPHA, _GAMMA = 0.25, 2.0
_BETA = 1.0 / 9.0
WEIGHTS = {"class": 1.0, "box": 2.0, "direction": 0.2}


def anchor_losses(
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
    return {name: WEIGHTS[name] * value for name, value in losses.items()}


def sine_difference(residual: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
    """Replace the angles so that the difference of the last columns is the sine of the angle difference."""
    a, b = residual[:, 6:7], target[:, 6:7]
    return (
        torch.cat([residual[:, :6], torch.sin(a) * torch.cos(b)], 1),
        torch.cat([target[:, :6], torch.cos(a) * torch.sin(b)], 1),
    )


def _box_loss(residual: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    predicted, expected = sine_difference(residual, target)
    return (functional.smooth_l1_loss(predicted, expected, beta=_BETA, reduction="none").sum(1) * weight).sum()


def _focal(logits: Tensor, target: Tensor) -> Tensor:
    probability = torch.sigmoid(logits)
    alpha = target * _ALPHA + (1 - target) * (1 - _ALPHA)
    error = target * (1 - probability) + (1 - target) * probability
    plain = functional.binary_cross_entropy_with_logits(logits, target, reduction="none")
    return alpha * error**_GAMMA * plain
