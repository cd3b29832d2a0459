"""Anchor boxes of KITTI's classes, at every cell and in two headings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from training.data.grid import Grid
from training.errors import TrainingError


@dataclass(frozen=True)
class AnchorClass:
    """The anchors of a class.

    Attributes:
        size: length, width, height [m].
        bottom_m: height of the bottom above the LiDAR.
        matched: minimum overlap of a positive anchor.
        unmatched: overlap below which an anchor is background.
    """

    size: tuple[float, float, float]
    bottom_m: float
    matched: float
    unmatched: float


#: Sizes, heights and thresholds of PointPillars and SECOND on KITTI.
KNOWN = {
    "Car": AnchorClass((3.9, 1.6, 1.56), -1.78, 0.6, 0.45),
    "Pedestrian": AnchorClass((0.8, 0.6, 1.73), -0.6, 0.5, 0.35),
    "Cyclist": AnchorClass((1.76, 0.6, 1.73), -0.6, 0.5, 0.35),
}
HEADINGS_RAD = (0.0, 1.57)


def anchor_classes(names: Sequence[str]) -> list[AnchorClass]:
    """Anchors of the classes.

    Raises:
        TrainingError: a class has no anchors.
    """
    unknown = [name for name in names if name not in KNOWN]
    if unknown:
        raise TrainingError(f"no anchors for class {unknown[0]!r}; choose among {', '.join(KNOWN)}")
    return [KNOWN[name] for name in names]


def make_anchors(classes: Sequence[AnchorClass], grid: Grid, stride: int) -> Tensor:
    """Anchors (rows, columns, classes, headings, 7) float32, rows along y; the outermost on the range's edges."""
    nx, ny, _ = grid.cells
    x = torch.linspace(grid.low[0], grid.high[0], nx // stride)
    y = torch.linspace(grid.low[1], grid.high[1], ny // stride)
    anchors = torch.zeros(len(y), len(x), len(classes), len(HEADINGS_RAD), 7)
    anchors[..., 0] = x[None, :, None, None]
    anchors[..., 1] = y[:, None, None, None]
    for number, item in enumerate(classes):
        anchors[:, :, number, :, 2] = item.bottom_m + item.size[2] / 2
        anchors[:, :, number, :, 3:6] = torch.tensor(item.size)
    anchors[..., 6] = torch.tensor(HEADINGS_RAD)
    return anchors
