"""Draw a scan from above: forward is up, left is left."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cosim.drives.kitti import Boxes
from cosim.view.colours import BACKGROUND, GRID, MUTED, TEXT, class_colour, dimmed
from cosim.view.drawing import LabelPlacer, draw_path, draw_text, fill_polygon, text_size

_RING_STEP_M = 10
_OVERSAMPLING = 2
_LABEL_PX = 13
_EGO_ARROW_M = np.array([[1.3, 0], [-1.1, 0.85], [-0.6, 0], [-1.1, -0.85]])


@dataclass(frozen=True)
class GroundPlan:
    """A square map of LiDAR axes around the sensor.

    Attributes:
        reach_m: distance from the sensor to the edge of the map [m].
        size_px: width and height [px].
    """

    reach_m: float = 50.0
    size_px: int = 1400

    def pixels(self, xy: np.ndarray) -> np.ndarray:
        """Pixels (…, 2) as (column, row) of positions (…, ≥ 2) in LiDAR axes [m]; integers are pixel centres."""
        scale = self.size_px / (2 * self.reach_m)
        return (self.reach_m - np.asarray(xy, np.float64)[..., 1::-1]) * scale - 0.5


def draw_from_above(points: np.ndarray, colours: np.ndarray, plan: GroundPlan) -> np.ndarray:
    """Draw points on a grid with range rings; the highest point of a pixel is visible.

    Args:
        points: (n, ≥ 3) in LiDAR axes [m].
        colours: (n, 3) uint8 RGB.
        plan: area and size of the map.

    Returns:
        (size, size, 3) uint8 RGB.
    """
    fine = GroundPlan(plan.reach_m, plan.size_px * _OVERSAMPLING)
    image = np.full((fine.size_px, fine.size_px, 3), BACKGROUND, np.uint8)
    _draw_rings(image, fine)
    order = np.argsort(points[:, 2], kind="stable")
    pixel = np.rint(fine.pixels(points[order])).astype(int)
    for across in range(-1, 3):
        for down in range(-1, 3):
            x, y = pixel[:, 0] + across, pixel[:, 1] + down
            inside = (x >= 0) & (x < fine.size_px) & (y >= 0) & (y < fine.size_px)
            image[y[inside], x[inside]] = colours[order[inside]]
    image = cv2.resize(image, (plan.size_px, plan.size_px), interpolation=cv2.INTER_AREA)
    fill_polygon(image, plan.pixels(_EGO_ARROW_M), TEXT)
    _name_rings(image, plan)
    return image


def draw_outlines(
    image: np.ndarray, boxes: Boxes, types: tuple[str, ...], plan: GroundPlan, thickness: int = 1
) -> None:
    """Draw boxes with a stroke from the middle out through the front."""
    for row, kind in enumerate(types):
        colour = class_colour(kind)
        corners = boxes.corners[row, :4, :2]
        front = (corners[0] + corners[3]) / 2
        ahead = front + (front - boxes.centre[row, :2]) * 0.35
        draw_path(image, plan.pixels(corners), colour, thickness, closed=True)
        draw_path(image, plan.pixels(np.stack([boxes.centre[row, :2], ahead])), colour, thickness)


def name_boxes(image: np.ndarray, boxes: Boxes, types: tuple[str, ...], plan: GroundPlan) -> None:
    """Write class and distance next to the boxes within the map, the nearest box first."""
    placer = LabelPlacer(image, _LABEL_PX)
    distance = np.hypot(boxes.centre[:, 0], boxes.centre[:, 1])
    for row in np.argsort(distance, kind="stable"):
        if np.abs(boxes.centre[row, :2]).max() > plan.reach_m:
            continue
        text = f"{types[row]} {distance[row]:.0f} m"
        x, y = plan.pixels(boxes.centre[row])
        span = np.ptp(plan.pixels(boxes.corners[row, :4]), axis=0) / 2
        right, low = span[0] + text_size(text, _LABEL_PX)[0] / 2 + 14, span[1] + 22
        near = [(x + right, y), (x - right, y), (x, y - low), (x, y + low)]
        far = [(x + right, y - 26), (x - right, y - 26), (x + right, y + 26), (x - right, y + 26)]
        placer.place(text, near + far, class_colour(types[row]))


def _draw_rings(image: np.ndarray, plan: GroundPlan) -> None:
    turn = np.linspace(0, 2 * np.pi, 361)
    circle = np.stack([np.cos(turn), np.sin(turn)], -1)
    farthest = int(plan.reach_m * 1.5)
    for radius in range(_RING_STEP_M, farthest, _RING_STEP_M):
        draw_path(image, plan.pixels(circle * radius), GRID, _OVERSAMPLING)
    for step in np.arange(-plan.reach_m, plan.reach_m + 1, _RING_STEP_M):
        dim = dimmed(GRID, 0.62) if step else GRID
        for ends in ([[step, -plan.reach_m], [step, plan.reach_m]], [[-plan.reach_m, step], [plan.reach_m, step]]):
            draw_path(image, plan.pixels(np.array(ends)), dim, _OVERSAMPLING)


def _name_rings(image: np.ndarray, plan: GroundPlan) -> None:
    for radius in range(_RING_STEP_M, int(plan.reach_m) + 1, _RING_STEP_M):
        position = plan.pixels(np.array([0.7071, -0.7071]) * radius)
        draw_text(image, f"{radius} m", (position[0], position[1]), 9, MUTED, (0.5, 0.5), BACKGROUND)
    draw_text(image, "x forward", (plan.size_px / 2, 12), 11, MUTED, (0.5, 0), BACKGROUND)
    draw_text(image, "y left", (12, plan.size_px / 2), 11, MUTED, (0, 0.5), BACKGROUND)
