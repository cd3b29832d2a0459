"""Frames on level ground: heights relative to the local ground, so that a detector need not learn the slope of streets.

A cell is ground if it is not higher than a maximum slope from all neighbouring cells allows (Vosselman, "Slope based
filtering of laser altimetry data", ISPRS 2000). The surface is smoothed, and cells above it are down-weighted
iteratively. Cells without ground are filled from the nearest ones, weighted by distance (normalised convolution:
Knutsson & Westin, CVPR 1993); around the ego vehicle the ground is level.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor
from torch.nn import functional

from sensors.cameras.kitti_rig import LIDAR_IN_EGO_M
from training.data.batch import Batch
from training.data.grid import Grid

#: Height of level ground in LiDAR axes [m].
LEVEL_M = -LIDAR_IN_EGO_M[2]
_CELL_M = 0.8
_DEEPEST_M, _HIGHEST_M = -4.0, 2.0  # limits of the ground height in LiDAR axes
_STEEPEST = 0.12  # maximum slope of a street in the axes of a slightly tilted LiDAR
_REACH = 7  # radius of the slope test in cells, longer than a car
_OWN_M = (4.0, 1.6)  # footprint of the ego vehicle, without points: half length and half width
_OWN_WEIGHT = 0.3  # weight of such a cell relative to a measured one
_WIDTHS = (1.5, 4.0, 12.0)  # standard deviations of the weights by distance, in cells
_WEIGHTS = (1.0, 0.03, 0.001)  # their weights: wide kernels dominate only where narrow ones contain no data
_PRIOR = 1e-6  # weight of the prior, level ground
_MAX_ABOVE_M = (0.30, 0.20, 0.12)  # per iteration: cells higher above the surface are down-weighted


@dataclass(frozen=True, eq=False)
class LocalGround:
    """Ground height of a batch of frames.

    Attributes:
        height: (frames, ny, nx) [m], at the centres of cells.
        low, high: corners of the grid, x and y [m].
    """

    height: Tensor
    low: tuple[float, float]
    high: tuple[float, float]

    def rise(self, frame: Tensor, xy: Tensor) -> Tensor:
        """Ground height above the level (n,) [m] in frames (n,) int64 at positions (n, 2); bilinear interpolation."""
        ny, nx = self.height.shape[1:]
        size = xy.new_tensor([nx, ny])
        low, high = xy.new_tensor(self.low), xy.new_tensor(self.high)
        position = ((xy - low) / (high - low) * size - 0.5).clamp(min=0)
        position = torch.minimum(position, size - 1)
        corner = position.floor().long().clamp(max=torch.tensor([nx - 2, ny - 2], device=xy.device))
        x, y = corner.T
        a, b = (position - corner).T
        h = self.height
        near = (1 - a) * h[frame, y, x] + a * h[frame, y, x + 1]
        far = (1 - a) * h[frame, y + 1, x] + a * h[frame, y + 1, x + 1]
        return (1 - b) * near + b * far - LEVEL_M

    def levelled(self, batch: Batch) -> Batch:
        """Return the frames with heights of points and boxes relative to level ground."""
        points = batch.points.clone()
        points[:, 3] -= self.rise(points[:, 0].long(), points[:, 1:3])
        boxes = tuple(self._shifted(frame_boxes, frame, -1) for frame, frame_boxes in enumerate(batch.boxes))
        return replace(batch, points=points, boxes=boxes)

    def raised(self, boxes: Tensor, frame: int) -> Tensor:
        """Transform boxes (n, 7) on level ground back to the heights of a frame."""
        return self._shifted(boxes, frame, 1)

    def _shifted(self, boxes: Tensor, frame: int, sign: int) -> Tensor:
        rise = self.rise(torch.full((len(boxes),), frame, device=boxes.device), boxes[:, :2])
        return torch.cat([boxes[:, :2], boxes[:, 2:3] + sign * rise[:, None], boxes[:, 3:]], 1)


@torch.no_grad()
def find_ground(points: Tensor, frames: int, grid: Grid) -> LocalGround:
    """Estimate the ground of a batch of frames.

    Args:
        points: (n, 5) index of the frame, x, y, z [m], intensity.
        frames: number of frames.
        grid: grid whose horizontal range is covered.
    """
    low, high = grid.low[:2], grid.high[:2]
    nx, ny = (max(2, round((h - b) / _CELL_M)) for b, h in zip(low, high, strict=True))
    lowest = _lowest_points(points, frames, (nx, ny), low, high)
    own_vehicle = _mask_own_vehicle(lowest, low, high)
    weight_seen = torch.where(torch.isinf(lowest) & own_vehicle, _OWN_WEIGHT, torch.isfinite(lowest).float())
    lowest = torch.where(torch.isinf(lowest) & own_vehicle, LEVEL_M, lowest)
    possible = _limit_slopes(lowest, (high[0] - low[0]) / nx)
    surface = _smooth(torch.where(weight_seen > 0, possible, LEVEL_M), weight_seen)
    seen = torch.where(weight_seen > 0, lowest, LEVEL_M)
    for limit_m in _MAX_ABOVE_M:
        above = seen - torch.minimum(surface, possible)
        surface = _smooth(seen, weight_seen * torch.exp(-((above / limit_m).clamp(min=0) ** 2)))
    return LocalGround(surface, (low[0], low[1]), (high[0], high[1]))


def _lowest_points(
    points: Tensor, frames: int, cells: tuple[int, int], low: Sequence[float], high: Sequence[float]
) -> Tensor:
    """The lowest point of each cell (frames, ny, nx) [m], infinite for empty cells."""
    nx, ny = cells
    corner = points.new_tensor(low)
    size = (points.new_tensor(high) - corner) / points.new_tensor([nx, ny])
    position = torch.floor((points[:, 1:3] - corner) / size).long()
    z = points[:, 3]
    inside = ((position >= 0) & (position < torch.tensor(cells, device=points.device))).all(1)
    inside &= (z > _DEEPEST_M) & (z < _HIGHEST_M)
    key = (points[inside, 0].long() * ny + position[inside, 1]) * nx + position[inside, 0]
    lowest = points.new_full((frames * ny * nx,), torch.inf).scatter_reduce(0, key, z[inside], "amin")
    return lowest.reshape(frames, ny, nx)


def _mask_own_vehicle(heights: Tensor, low: Sequence[float], high: Sequence[float]) -> Tensor:
    """Mask (ny, nx) of the cells under the ego vehicle."""
    ny, nx = heights.shape[1:]
    x = low[0] + (torch.arange(nx, device=heights.device) + 0.5) * (high[0] - low[0]) / nx
    y = low[1] + (torch.arange(ny, device=heights.device) + 0.5) * (high[1] - low[1]) / ny
    return (x.abs() < _OWN_M[0])[None] & (y.abs() < _OWN_M[1])[:, None]


def _limit_slopes(heights: Tensor, cell_m: float) -> Tensor:
    """Maximum ground height allowed by the slope from neighbouring cells (frames, ny, nx) [m]; infinite without any."""
    ny, nx = heights.shape[1:]
    wide = functional.pad(heights, (_REACH,) * 4, value=torch.inf)
    lowest = heights
    for row in range(2 * _REACH + 1):
        for column in range(2 * _REACH + 1):
            rise = _STEEPEST * cell_m * math.hypot(row - _REACH, column - _REACH)
            lowest = torch.minimum(lowest, wide[:, row : row + ny, column : column + nx] + rise)
    return lowest


def _smooth(heights: Tensor, weight: Tensor) -> Tensor:
    """Weighted means (frames, ny, nx) over a neighbourhood that is wider where data are sparse."""
    total = _PRIOR * torch.ones_like(heights)
    summed = LEVEL_M * total
    for width, share in zip(_WIDTHS, _WEIGHTS, strict=True):
        summed = summed + share * _blur(weight * heights, width)
        total = total + share * _blur(weight, width)
    return summed / total


def _blur(image: Tensor, width: float) -> Tensor:
    """Convolve an image (frames, ny, nx) with a Gaussian kernel, zero-padded."""
    reach = round(3 * width)
    offsets = torch.arange(-reach, reach + 1, device=image.device, dtype=image.dtype)
    kernel = torch.exp(-0.5 * (offsets / width) ** 2)
    kernel = kernel / kernel.sum()
    rows = functional.conv2d(image[:, None], kernel[None, None, None], padding=(0, reach))
    return functional.conv2d(rows, kernel[None, None, :, None], padding=(reach, 0))[:, 0]
