"""Regions of interest of a second stage: sampling for training, losses, and refined boxes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from training.data.batch import Batch
from training.evaluation.rotated_overlap import paired_intersections
from training.models.coding import decode, encode, within_period
from training.models.roi_pool import grid_points

_IOU_HIGH, _IOU_LOW, _IOU_REFINED = 0.75, 0.25, 0.55
_POSITIVE_SHARE = 0.5
# Standard deviations of x, y, z [m], logarithms of sizes, heading [rad].
_JITTER_SD = (0.3, 0.2, 0.1, 0.08, 0.05, 0.06, 0.08)
_ON_IGNORED = 0.25  # minimum overlap of a region on an ignored object, which is not used in training


@dataclass(frozen=True, eq=False)
class Regions:
    """Training regions of a batch.

    Attributes:
        boxes: (n, 7) regions.
        frame: (n,) int64 frame of each region.
        objects: (n, 7) object with the largest overlap; the region itself in frames without objects.
        overlap: (n,) overlap with that object, 0–1.
    """

    boxes: Tensor
    frame: Tensor
    objects: Tensor
    overlap: Tensor


@torch.no_grad()
def regions_to_learn(
    batch: Batch, propose: Callable[[int], Tensor], count: int, copies: int, generator: torch.Generator
) -> Regions:
    """Select training regions of each frame: proposals, true boxes, and jittered true boxes.

    Args:
        batch: the frames.
        propose: returns proposed boxes (m, 7) of a frame.
        count: maximum number of regions per frame.
        copies: number of jittered copies of each true box.
        generator: random generator, on the CPU.
    """
    parts = []
    for frame in range(len(batch)):
        counts = batch.class_ids[frame] >= 0
        objects, ignored = batch.boxes[frame][counts], batch.boxes[frame][~counts]
        offered = torch.cat([propose(frame), objects, _jitter_boxes(objects, copies, generator)])
        boxes, matched, overlap = choose_rois(_drop_on_ignored(offered, ignored, objects), objects, count, generator)
        parts.append((boxes, torch.full((len(boxes),), frame, device=boxes.device), matched, overlap))
    return Regions(*(torch.cat(parts_of_field) for parts_of_field in zip(*parts, strict=True)))


def _jitter_boxes(boxes: Tensor, copies: int, generator: torch.Generator) -> Tensor:
    """Copies of boxes (n, 7) with errors like those of proposals."""
    many = boxes.repeat(copies, 1)
    draws = torch.randn(many.shape, generator=generator).to(many) * many.new_tensor(_JITTER_SD)
    centre, size = many[:, :3] + draws[:, :3], many[:, 3:6] * torch.exp(draws[:, 3:6])
    return torch.cat([centre, size, many[:, 6:] + draws[:, 6:]], 1)


def _drop_on_ignored(boxes: Tensor, ignored: Tensor, objects: Tensor) -> Tensor:
    """Drop boxes that overlap ignored objects and no others."""
    if not len(ignored):
        return boxes
    on_ignored = overlap_3d(boxes, ignored).amax(1) > _ON_IGNORED
    if len(objects):
        on_ignored &= overlap_3d(boxes, objects).amax(1) < _ON_IGNORED
    return boxes[~on_ignored]


def overlap_3d(a: Tensor, b: Tensor) -> Tensor:
    """Intersection over union of all pairs of boxes (n, 7), (m, 7): (n, m) float32 on the same device."""
    first, second = (t.detach().double().cpu().numpy() for t in (a, b))
    left, right = np.repeat(np.arange(len(first)), len(second)), np.tile(np.arange(len(second)), len(first))
    columns = [0, 1, 3, 4, 6]
    shared = paired_intersections(first[left][:, columns], second[right][:, columns])
    top = np.minimum(first[left, 2] + first[left, 5] / 2, second[right, 2] + second[right, 5] / 2)
    bottom = np.maximum(first[left, 2] - first[left, 5] / 2, second[right, 2] - second[right, 5] / 2)
    shared *= np.clip(top - bottom, 0, None)
    union = first[left, 3:6].prod(1) + second[right, 3:6].prod(1) - shared
    return torch.from_numpy((shared / np.maximum(union, 1e-9)).reshape(len(first), len(second))).to(a)


def choose_rois(rois: Tensor, objects: Tensor, count: int, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Sample training regions, at most half of them on objects.

    Args:
        rois: (n, 7).
        objects: (m, 7).
        count: maximum number of regions.
        generator: random generator, on the CPU.

    Returns:
        Chosen regions (k, 7), the object of each (k, 7), and the overlap with it (k,).
    """
    if not len(objects):
        chosen = rois[:count]
        return chosen, chosen, chosen.new_zeros(len(chosen))
    overlap, object_rows = overlap_3d(rois, objects).max(1)
    positive = torch.nonzero(overlap >= _IOU_REFINED)[:, 0]
    negative = torch.nonzero(overlap < _IOU_REFINED)[:, 0]
    chosen = _draw(positive, round(count * _POSITIVE_SHARE), generator)
    rows = torch.cat([chosen, _draw(negative, count - len(chosen), generator)])
    return rois[rows], objects[object_rows[rows]], overlap[rows]


def roi_losses(scores: Tensor, residuals: Tensor, rois: Tensor, objects: Tensor, overlap: Tensor) -> dict[str, Tensor]:
    """Losses of regions: the target of the score is the overlap, that of residuals and corners the object."""
    target_score = ((overlap - _IOU_LOW) / (_IOU_HIGH - _IOU_LOW)).clamp(0, 1)
    losses = {"roi_class": functional.binary_cross_entropy_with_logits(scores, target_score)}
    rows = torch.nonzero(overlap >= _IOU_REFINED)[:, 0]
    count = max(len(rows), 1)
    local, anchor = in_region(objects[rows], rois[rows])
    target = encode(local, anchor)
    box = functional.smooth_l1_loss(residuals[rows], target, beta=1 / 9, reduction="sum") / count
    corners = _corners(decode(residuals[rows], anchor))
    turned = torch.cat([local[:, :6], local[:, 6:] + math.pi], 1)
    gap = torch.minimum((corners - _corners(local)).norm(dim=-1), (corners - _corners(turned)).norm(dim=-1))
    corner = torch.where(gap < 1, 0.5 * gap**2, gap - 0.5).mean(1).sum() / count
    return {**losses, "roi_box": box, "roi_corner": corner}


def refine(rois: Tensor, residuals: Tensor) -> Tensor:
    """Boxes (n, 7) of residuals given in the axes of regions (n, 7)."""
    local = decode(residuals, _anchor(rois))
    cos, sin = torch.cos(rois[:, 6]), torch.sin(rois[:, 6])
    x = cos * local[:, 0] - sin * local[:, 1] + rois[:, 0]
    y = sin * local[:, 0] + cos * local[:, 1] + rois[:, 1]
    return torch.stack([x, y, local[:, 2] + rois[:, 2], *local[:, 3:6].T, local[:, 6] + rois[:, 6]], 1)


def in_region(objects: Tensor, rois: Tensor) -> tuple[Tensor, Tensor]:
    """Objects in the axes of their regions, heading modulo 180°; and the regions in their own axes."""
    offset = objects[:, :3] - rois[:, :3]
    cos, sin = torch.cos(rois[:, 6]), torch.sin(rois[:, 6])
    x, y = cos * offset[:, 0] + sin * offset[:, 1], cos * offset[:, 1] - sin * offset[:, 0]
    yaw = within_period(objects[:, 6] - rois[:, 6], 0.5, math.pi)
    return torch.stack([x, y, offset[:, 2], *objects[:, 3:6].T, yaw], 1), _anchor(rois)


def _anchor(rois: Tensor) -> Tensor:
    return torch.cat([torch.zeros_like(rois[:, :3]), rois[:, 3:6], torch.zeros_like(rois[:, 6:])], 1)


def _corners(boxes: Tensor) -> Tensor:
    return grid_points(torch.cat([boxes[:, :3], 2 * boxes[:, 3:6], boxes[:, 6:]], 1), 2)


def _draw(rows: Tensor, count: int, generator: torch.Generator) -> Tensor:
    return rows[torch.randperm(len(rows), generator=generator)[:count].to(rows.device)]
