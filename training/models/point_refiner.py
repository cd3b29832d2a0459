"""A second stage for two CPU cores: correct each proposed box from the points in and around it.

Points are expressed in the axes of the box, mirrored to point away from the sensor, so that the visible faces are
always the same two. The features of a point include its distances from all faces of the box; without them a point
network does not know the size of the box (Li, Wang & Wang, "LiDAR R-CNN:
An Efficient and Universal 3D Object Detector", CVPR 2021, section 4).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from training.data.level_ground import LEVEL_M

FEATURES = 11  # position in the box, distances from its six faces, height above the ground, intensity
_MARGIN_M = (0.9, 0.6)  # margin around the box, along and across it
_ABOVE_M, _BELOW_M = 0.5, 0.3  # beyond its top and bottom
_GROUND_M = 0.15  # points closer to the ground are excluded
_NARROW, _WIDE, _POOLED = 64, 128, 256


class PointRefiner(nn.Module):
    """Scores (k,) and residuals (k, 7) of regions, from the points in them.

    Args:
        width: width of the layers after pooling.
        most_points: maximum number of points per region, evenly spaced in their order.
        dropout: dropout rate of the layers after pooling.
    """

    def __init__(self, width: int, most_points: int, dropout: float) -> None:
        super().__init__()
        self._most = most_points
        self.points = nn.Sequential(*_layer(FEATURES, _NARROW), *_layer(_NARROW, _WIDE))
        self.surroundings = nn.Linear(_WIDE, _WIDE, bias=False)
        self.points_again = nn.Linear(_WIDE, _WIDE, bias=False)
        self.pooled = nn.Sequential(nn.BatchNorm1d(_WIDE), nn.ReLU(), *_layer(_WIDE, _POOLED))
        self.region = nn.Sequential(*_layer(_POOLED, width), nn.Dropout(dropout), *_layer(width, width))
        self.score = nn.Linear(width, 1)
        self.residual = nn.Linear(width, 7)
        nn.init.normal_(self.residual.weight, std=0.001)
        nn.init.zeros_(self.residual.bias)

    def forward(self, points: Tensor, boxes: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (k,) and residuals (k, 7) in the axes of the regions.

        Args:
            points: (n, 5) index of the frame, x, y, z [m] on level ground, intensity.
            boxes: (k, 7) regions.
            frame: (k,) int64 frame of each region.
        """
        if not len(boxes):
            return boxes.new_zeros(0), boxes.new_zeros(0, 7)
        mirrored = _mirror_signs(boxes)
        features, has_points = gather(points, boxes, frame, mirrored, self._most)
        count, most = features.shape[:2]
        each = self.points(features.flatten(0, 1))
        context = each.reshape(count, most, -1).amax(1)
        combined = self.points_again(each).reshape(count, most, -1) + self.surroundings(context)[:, None]
        pooled = self.pooled(combined.flatten(0, 1)).reshape(count, most, -1).amax(1)
        whole = self.region(pooled * has_points[:, None])
        signs = torch.ones_like(boxes)
        signs[:, :2], signs[:, 6] = mirrored, mirrored.prod(1)
        return self.score(whole)[:, 0], self.residual(whole) * signs


@torch.no_grad()
def gather(points: Tensor, boxes: Tensor, frame: Tensor, mirrored: Tensor, most: int) -> tuple[Tensor, Tensor]:
    """Gather the points of regions: features (k, most, FEATURES), and whether a region has any, (k,) bool.

    Fewer points are repeated, more are thinned evenly.

    Args:
        points: (n, 5) index of the frame, x, y, z [m] on level ground, intensity.
        boxes: (k, 7) regions.
        frame: (k,) int64 frame of each region.
        mirrored: (k, 2) signs ±1 along and across.
        most: number of points per region.
    """
    points = points[points[:, 3] > LEVEL_M + _GROUND_M]
    region, row = _nearby_points(points, boxes, frame)
    local = _to_box_axes(points[row, 1:4], boxes[region], mirrored[region])
    half = boxes[region, 3:6] / 2
    beyond = local.abs() - half
    inside = (beyond[:, :2] < beyond.new_tensor(_MARGIN_M)).all(1)
    inside &= (local[:, 2] < half[:, 2] + _ABOVE_M) & (local[:, 2] > -half[:, 2] - _BELOW_M)
    region, row, local, half = region[inside], row[inside], local[inside], half[inside]
    above = points[row, 3:4] - LEVEL_M
    features = torch.cat([local, half - local, half + local, above, points[row, 4:5]], 1)
    count = torch.bincount(region, minlength=len(boxes))
    first = torch.cumsum(count, 0) - count
    number = torch.arange(most, device=points.device)[None]
    many = count[:, None].clamp(min=1)
    chosen = first[:, None] + torch.where(many > most, number * many // most, number % many)
    padded = torch.cat([features, features.new_zeros(1, FEATURES)])
    return padded[chosen.clamp(max=len(features))], count > 0


def _nearby_points(points: Tensor, boxes: Tensor, frame: Tensor) -> tuple[Tensor, Tensor]:
    """Pairs of regions and points within a circle around them: rows of both, sorted by region."""
    reach = torch.hypot(boxes[:, 3] / 2 + _MARGIN_M[0], boxes[:, 4] / 2 + _MARGIN_M[1])
    regions, rows = [], []
    for number in torch.unique(frame).tolist():
        region_rows, point_rows = torch.nonzero(frame == number)[:, 0], torch.nonzero(points[:, 0] == number)[:, 0]
        near = torch.cdist(boxes[region_rows, :2], points[point_rows, 1:3]) < reach[region_rows, None]
        region, row = torch.nonzero(near, as_tuple=True)
        regions.append(region_rows[region])
        rows.append(point_rows[row])
    region, row = torch.cat(regions), torch.cat(rows)
    order = torch.argsort(region, stable=True)
    return region[order], row[order]


def _to_box_axes(positions: Tensor, boxes: Tensor, mirrored: Tensor) -> Tensor:
    """Transform positions (n, 3) to the mirrored axes of boxes (n, 7)."""
    offset = positions - boxes[:, :3]
    cos, sin = torch.cos(boxes[:, 6]), torch.sin(boxes[:, 6])
    along, across = cos * offset[:, 0] + sin * offset[:, 1], cos * offset[:, 1] - sin * offset[:, 0]
    return torch.stack([along * mirrored[:, 0], across * mirrored[:, 1], offset[:, 2]], 1)


def _mirror_signs(boxes: Tensor) -> Tensor:
    """Signs (k, 2) of axes along and across boxes (k, 7) that point away from the sensor, at the origin."""
    cos, sin = torch.cos(boxes[:, 6]), torch.sin(boxes[:, 6])
    along, across = cos * boxes[:, 0] + sin * boxes[:, 1], cos * boxes[:, 1] - sin * boxes[:, 0]
    return torch.where(torch.stack([along, across], 1) >= 0, 1.0, -1.0)


def _layer(channels_in: int, channels: int) -> tuple[nn.Module, nn.Module, nn.Module]:
    return nn.Linear(channels_in, channels, bias=False), nn.BatchNorm1d(channels), nn.ReLU()
