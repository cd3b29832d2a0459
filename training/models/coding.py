"""Boxes as residuals of anchors, and angles brought into a period (Yan et al., SECOND, Sensors 2018, eq. 1)."""

from __future__ import annotations

import math

import torch
from torch import Tensor

DIRECTIONS = 2


def encode(boxes: Tensor, anchors: Tensor) -> Tensor:
    """Residuals (…, 7) of boxes (…, 7) against anchors (…, 7): centre by diagonal and height, sizes as logarithms."""
    diagonal = torch.hypot(anchors[..., 3], anchors[..., 4])
    scale = torch.stack([diagonal, diagonal, anchors[..., 5]], -1)
    centre = (boxes[..., :3] - anchors[..., :3]) / scale
    size = torch.log(boxes[..., 3:6].clamp(min=1e-3) / anchors[..., 3:6])
    return torch.cat([centre, size, boxes[..., 6:7] - anchors[..., 6:7]], -1)


def decode(residuals: Tensor, anchors: Tensor) -> Tensor:
    """The boxes of residuals; the inverse of `encode`."""
    diagonal = torch.hypot(anchors[..., 3], anchors[..., 4])
    scale = torch.stack([diagonal, diagonal, anchors[..., 5]], -1)
    centre = residuals[..., :3] * scale + anchors[..., :3]
    size = torch.exp(residuals[..., 3:6].clamp(-5, 5)) * anchors[..., 3:6]
    return torch.cat([centre, size, residuals[..., 6:7] + anchors[..., 6:7]], -1)


def within_period(angle: Tensor, offset: float, period: float) -> Tensor:
    """Angles [rad] brought into [−offset · period, (1 − offset) · period)."""
    return angle - torch.floor(angle / period + offset) * period


def direction_of(yaw: Tensor, offset: float) -> Tensor:
    """Which half-turn a heading lies in, int64: 0 for that which begins at `offset` [rad], else 1."""
    turned = within_period(yaw - offset, 0.0, 2 * math.pi)
    return torch.floor(turned / (2 * math.pi / DIRECTIONS)).long().clamp(0, DIRECTIONS - 1)


def with_direction(yaw: Tensor, direction: Tensor, offset: float) -> Tensor:
    """Headings known up to a half-turn, turned into the half-turn that was classified."""
    period = 2 * math.pi / DIRECTIONS
    within = within_period(yaw - offset, 0.0, period)
    return within_period(within + offset + period * direction, 0.5, 2 * math.pi)
