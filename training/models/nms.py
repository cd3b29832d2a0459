"""Detections, and non-maximum suppression in the bird's-eye view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from training.evaluation.rotated_overlap import paired_iou

_BEV = [0, 1, 3, 4, 6]
_BLOCK = 64  # candidates processed together


@dataclass(frozen=True, eq=False)
class Detections:
    """Detections of a frame.

    Attributes:
        boxes: (k, 7) float32 centre, length, width, height [m], yaw [rad], LiDAR axes.
        scores: (k,) float32 0–1, descending.
        kinds: (k,) int64 class index.
    """

    boxes: np.ndarray
    scores: np.ndarray
    class_ids: np.ndarray


@torch.no_grad()
def suppress(boxes: Tensor, scores: Tensor, overlap: float, *, before: int, after: int) -> Tensor:
    """Non-maximum suppression: rows to keep of boxes (n, 7) with scores (n,), in descending order of score.

    Args:
        boxes: boxes, on any device.
        scores: scores of the boxes.
        overlap: maximum bird's-eye intersection over union of kept boxes.
        before: maximum number of candidates, by score.
        after: maximum number of kept boxes.
    """
    order = torch.argsort(scores, descending=True, stable=True)[:before]
    table = boxes[order].detach().float().cpu().numpy()[:, _BEV].astype(np.float64)
    kept = _greedy(table, overlap, after)
    return order[torch.from_numpy(kept).to(order.device)]


def _greedy(table: np.ndarray, overlap: float, after: int) -> np.ndarray:
    """Rows to keep of rectangles (n, 5) in descending order of score, processed in blocks."""
    kept = np.zeros(0, np.int64)
    for start in range(0, len(table), _BLOCK):
        block = np.arange(start, min(start + _BLOCK, len(table)))
        block = block[~_overlapping(table, kept, block, overlap).any(0)]
        overlaps = _overlapping(table, block, block, overlap)
        is_kept = np.ones(len(block), bool)
        for row in range(len(block)):
            if is_kept[row]:
                is_kept[row + 1 :] &= ~overlaps[row, row + 1 :]
        kept = np.concatenate([kept, block[is_kept]])
        if len(kept) >= after:
            break
    return kept[:after]


def _overlapping(table: np.ndarray, first: np.ndarray, second: np.ndarray, overlap: float) -> np.ndarray:
    """Whether rectangles overlap by more than `overlap`, (n, m) bool; distant pairs are skipped."""
    a, b = table[first], table[second]
    reach = (np.hypot(a[:, 2], a[:, 3])[:, None] + np.hypot(b[:, 2], b[:, 3])[None]) / 2
    gap = np.hypot(*(a[:, None, :2] - b[None, :, :2]).transpose(2, 0, 1))
    left, right = np.nonzero(gap < reach * min(1.0, 1.2 * (1 - overlap)))
    result = np.zeros(gap.shape, bool)
    result[left, right] = paired_iou(a[left], b[right]) > overlap
    return result
