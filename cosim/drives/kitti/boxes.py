"""Upright boxes in axes with z up: corners, and which points lie inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.errors import FormatError

# Bottom four counter-clockwise seen from above, front left first; then the top four in the same order.
_CORNERS = np.array(
    [[1, 1, -1], [-1, 1, -1], [-1, -1, -1], [1, -1, -1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]], float
)


def wrap_angle(angle: np.ndarray) -> np.ndarray:
    """Angles [rad] brought into [−π, π)."""
    return (np.asarray(angle, np.float64) + np.pi) % (2 * np.pi) - np.pi


@dataclass(frozen=True, eq=False)
class Boxes:
    """Upright boxes.

    Attributes:
        centre: (n, 3) float64 centre of the box [m].
        size: (n, 3) float64 length (along the heading), width, height [m].
        yaw: (n,) float64 heading [rad], counter-clockwise from +x.
    """

    centre: np.ndarray
    size: np.ndarray
    yaw: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", np.asarray(self.centre, np.float64).reshape(-1, 3))
        object.__setattr__(self, "size", np.asarray(self.size, np.float64).reshape(-1, 3))
        object.__setattr__(self, "yaw", np.asarray(self.yaw, np.float64).reshape(-1))
        if not len(self.centre) == len(self.size) == len(self.yaw):
            raise FormatError(f"boxes: {len(self.centre)} centres, {len(self.size)} sizes, {len(self.yaw)} yaws")

    def __len__(self) -> int:
        return len(self.yaw)

    def __getitem__(self, rows: np.ndarray | slice) -> Boxes:
        """Some of the boxes, by mask, index array or slice."""
        return Boxes(self.centre[rows], self.size[rows], self.yaw[rows])

    @property
    def corners(self) -> np.ndarray:
        """(n, 8, 3) float64: the bottom four from front left counter-clockwise, then the top four."""
        local = _CORNERS * self.size[:, None] / 2
        cos, sin = np.cos(self.yaw)[:, None], np.sin(self.yaw)[:, None]
        x = cos * local[..., 0] - sin * local[..., 1]
        y = sin * local[..., 0] + cos * local[..., 1]
        return np.stack([x, y, local[..., 2]], -1) + self.centre[:, None]


def points_in_boxes(points: np.ndarray, boxes: Boxes, margin_m: float = 0.0) -> np.ndarray:
    """Assign points to the boxes that contain them.

    Args:
        points: (n, ≥ 3) in the axes of the boxes [m].
        boxes: m boxes.
        margin_m: added on every face; negative shrinks.

    Returns:
        (m, n) bool, the surface counted in.
    """
    xyz = np.asarray(points)[:, :3].astype(np.float64)
    inside = np.zeros((len(boxes), len(xyz)), bool)
    half = boxes.size / 2 + margin_m
    reach = np.hypot(half[:, 0], half[:, 1])
    for row in range(len(boxes)):
        near = np.flatnonzero(np.abs(xyz[:, 0] - boxes.centre[row, 0]) <= reach[row])
        offset = xyz[near] - boxes.centre[row]
        cos, sin = np.cos(boxes.yaw[row]), np.sin(boxes.yaw[row])
        along = cos * offset[:, 0] + sin * offset[:, 1]
        across = cos * offset[:, 1] - sin * offset[:, 0]
        local = np.abs(np.stack([along, across, offset[:, 2]], -1))
        inside[row, near[(local <= half[row]).all(1)]] = True
    return inside
