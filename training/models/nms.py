"""Detections, and suppressing those that overlap surer ones seen from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from training.evaluation.rotated_overlap import paired_iou

_BEV = [0, 1, 3, 4, 6]


@dataclass(frozen=True, eq=False)
class Detections:
    """What was found in a frame.

    Attributes:
        boxes: (k, 7) float32 centre, length, width, height [m], yaw [rad], LiDAR axes.
        scores: (k,) float32 0–1, descending.
        kinds: (k,) int64 class index.
    """

    boxes: np.ndarray
    scores: np.ndarray
    kinds: np.ndarray


@torch.no_grad()
def suppress(boxes: Tensor, scores: Tensor, overlap: float, *, before: int, after: int) -> Tensor:
    """Rows to keep of boxes (n, 7) with scores (n,): the surest first, none overlapping one kept by more.

    Args:
        boxes: on any device.
        scores: theirs.
        overlap: intersection over union from above, exclusive.
        before: only the surest so many are looked at.
        after: at most so many are kept.
    """
    order = torch.argsort(scores, descending=True, stable=True)[:before]
    table = boxes[order].detach().float().cpu().numpy()[:, _BEV].astype(np.float64)
    kept = _greedy(table, overlap, after)
    return order[torch.from_numpy(kept).to(order.device)]


def _greedy(table: np.ndarray, overlap: float, after: int) -> np.ndarray:
    reach = np.hypot(table[:, 2], table[:, 3]) / 2
    alive, kept = np.ones(len(table), bool), []
    for row in range(len(table)):
        if not alive[row]:
            continue
        kept.append(row)
        if len(kept) == after:
            break
        later = np.flatnonzero(alive[row + 1 :]) + row + 1
        gap = np.hypot(*(table[later, :2] - table[row, :2]).T)
        later = later[gap < reach[later] + reach[row]]
        iou = paired_iou(np.repeat(table[row : row + 1], len(later), 0), table[later])
        alive[later[iou > overlap]] = False
    return np.array(kept, np.int64)
