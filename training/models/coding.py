"""Encoding of boxes as residuals of anchors, and wrapping of angles (Yan et al., SECOND, Sensors 2018, eq. 1)."""

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
    """Decode residuals to boxes; the inverse of `encode`."""
    diagonal = torch.hypot(anchors[..., 3], anchors[..., 4])
    scale = torch.stack([diagonal, diagonal, anchors[..., 5]], -1)
    centre = residuals[..., :3] * scale + anchors[..., :3]
    size = torch.exp(residuals[..., 3:6].clamp(-5, 5)) * anchors[..., 3:6]
    return torch.cat([centre, size, residuals[..., 6:7] + anchors[..., 6:7]], -1)


def within_period(angle: Tensor, offset: float, period: float) -> Tensor:
    """Wrap angles [rad] into [−offset · period, (1 − offset) · period)."""
    return angle - torch.floor(angle / period + offset) * period


def direction_of(yaw: Tensor, offset: float) -> Tensor:
    """Half-turn that contains a heading, int64: 0 for the one that starts at `offset` [rad], otherwise 1."""
    turned = within_period(yaw - offset, 0.0, 2 * math.pi)
    return torch.floor(turned / (2 * math.pi / DIRECTIONS)).long().clamp(0, DIRECTIONS - 1)


def with_direction(yaw: Tensor, direction: Tensor, offset: float) -> Tensor:
    """Move headings that are known up to a half-turn into the classified half-turn."""
    period = 2 * math.pi / DIRECTIONS
    within = within_period(yaw - offset, 0.0, period)
    return within_period(within + offset + period * direction, 0.5, 2 * math.pi)
