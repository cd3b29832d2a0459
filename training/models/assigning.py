"""Assign targets to anchors: the object with the largest overlap of axis-aligned outlines, or background."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from training.models.anchors import AnchorClass
from training.models.coding import encode, within_period


@dataclass(frozen=True, eq=False)
class Targets:
    """Targets of all anchors of a batch.

    Attributes:
        label: (b, a) int64, class index + 1; 0 background, −1 neither.
        residual: (b, a, 7) float32 where label > 0.
        yaw: (b, a) float32 heading of the object where label > 0.
    """

    label: Tensor
    residual: Tensor
    yaw: Tensor


def upright_outlines(boxes: Tensor) -> Tensor:
    """Outlines (n, 4) x0, y0, x1, y1 of boxes (n, 7), aligned with the nearest axis."""
    angle = within_period(boxes[:, 6], 0.5, math.pi).abs()
    across = (angle > math.pi / 4)[:, None]
    size = torch.where(across, boxes[:, [4, 3]], boxes[:, [3, 4]])
    return torch.cat([boxes[:, :2] - size / 2, boxes[:, :2] + size / 2], 1)


def outline_iou(a: Tensor, b: Tensor) -> Tensor:
    """Intersection over union of all pairs of outlines (n, 4), (m, 4): (n, m)."""
    along, across = (_shared(a[:, [axis, axis + 2]], b[:, [axis, axis + 2]]) for axis in (0, 1))
    shared = along.mul_(across)
    areas = [(outlines[:, 2:] - outlines[:, :2]).prod(-1) for outlines in (a, b)]
    return shared / (areas[0][:, None] + areas[1][None] - shared).clamp_(min=1e-6)


def _shared(a: Tensor, b: Tensor) -> Tensor:
    """Lengths (n, m) that all pairs of intervals (n, 2), (m, 2) share."""
    (a0, a1), (b0, b1) = a.T.contiguous(), b.T
    return torch.minimum(a1[:, None], b1).sub_(torch.maximum(a0[:, None], b0)).clamp_(min=0)


@torch.no_grad()
def assign(
    anchors: Tensor, classes: Sequence[AnchorClass], boxes: Sequence[Tensor], class_ids: Sequence[Tensor]
) -> Targets:
    """Targets of anchors (rows, columns, classes, headings, 7) in frames with objects (m, 7) of classes (m,).

    The best anchor of each object is always positive. Anchors on ignored objects (class −1) are neither positive nor
    background.
    """
    shape = anchors.shape[:-1]
    label = torch.zeros(len(boxes), *shape, dtype=torch.long, device=anchors.device)
    residual, yaw = anchors.new_zeros(len(boxes), *shape, 7), anchors.new_zeros(len(boxes), *shape)
    for number, item in enumerate(classes):
        class_anchors = anchors[:, :, number].reshape(-1, 7)
        outlines = upright_outlines(class_anchors)
        for frame, (objects, kind) in enumerate(zip(boxes, class_ids, strict=True)):
            labels, object_rows = _match(outlines, item, objects, kind, number)
            label[frame, :, :, number] = labels.reshape(shape[0], shape[1], shape[3])
            rows = torch.nonzero(labels > 0)[:, 0]
            index = (frame, rows // shape[3] // shape[1], rows // shape[3] % shape[1], number, rows % shape[3])
            chosen = objects[object_rows[rows]]
            residual[index], yaw[index] = encode(chosen, class_anchors[rows]), chosen[:, 6]
    count = len(boxes)
    return Targets(label.reshape(count, -1), residual.reshape(count, -1, 7), yaw.reshape(count, -1))


def _match(
    outlines: Tensor, item: AnchorClass, objects: Tensor, class_ids: Tensor, number: int
) -> tuple[Tensor, Tensor]:
    """Label of each anchor of a class, and the row of its object."""
    label = torch.zeros(len(outlines), dtype=torch.long, device=outlines.device)
    object_rows = torch.zeros_like(label)
    ignored = class_ids == -1
    if ignored.any():
        near = outline_iou(outlines, upright_outlines(objects[ignored])).amax(1) > item.unmatched
        label[near] = -1
    rows = torch.nonzero(class_ids == number)[:, 0]
    if not len(rows):
        return label, object_rows
    overlap = outline_iou(outlines, upright_outlines(objects[rows]))
    best, index = overlap.max(1)
    label[best >= item.unmatched] = -1
    label[best >= item.matched] = number + 1
    object_rows = rows[index]
    top = overlap.amax(0)
    anchor, of = torch.nonzero((overlap == top) & (top > 0), as_tuple=True)
    label[anchor], object_rows[anchor] = number + 1, rows[of]
    return label, object_rows
