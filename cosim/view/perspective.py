"""Draw a scan from a virtual camera: behind and above the vehicle, or close to an object."""

from __future__ import annotations

import cv2
import numpy as np

from cosim.drives.kitti import Boxes
from cosim.view.colours import BACKGROUND, GRID, class_colour
from cosim.view.drawing import LabelPlacer, above, draw_segments
from cosim.view.projection import Viewpoint
from cosim.view.splatting import NOTHING, shade, splat

LIDAR_HEIGHT_M = 1.73  # of KITTI's car: Geiger et al., IJRR 2013, figure 3
_OVERSAMPLING = 2
_CLOSE_HALF_FIELD = 0.315  # tangent of half the vertical field of close-ups
_DISC_PER_M = 0.0036  # discs grow with the distance from the LiDAR, as the gaps between beams do
_DISC_LIMITS_M = (0.018, 0.16)
_DISC_LIMITS_PX = (1.0, 18.0)
_SHADES = ((2, 30.0), (7, 25.0))  # reach [px] and strength: creases, then shapes


def chase_view(width: int = 1600, height: int = 900) -> Viewpoint:
    """From behind and above the vehicle, looking forward along the street."""
    return Viewpoint.looking((-10.0, 0, 5.6), (12, 0, -1.9), width=width, height=height, field_deg=64, near_m=4.0)


def close_view(boxes: Boxes, row: int, width: int, height: int) -> Viewpoint:
    """One object at an angle from above, from the side that the LiDAR sees."""
    centre, size = boxes.centre[row], boxes.size[row]
    bearing = np.arctan2(-centre[1], -centre[0]) + np.radians(22)
    back = 1.0 + 1.25 * float(np.linalg.norm(size))
    eye = centre + back * np.array([np.cos(bearing), np.sin(bearing), 0.36])
    field_deg = 2 * np.degrees(np.arctan(width / height * _CLOSE_HALF_FIELD))
    return Viewpoint.looking(eye, centre, width=width, height=height, field_deg=field_deg, near_m=back * 0.35)


def draw_perspective(points: np.ndarray, colours: np.ndarray, view: Viewpoint) -> np.ndarray:
    """Points as shaded discs above a ground grid.

    Args:
        points: (n, ≥ 3) in LiDAR axes [m].
        colours: (n, 3) uint8 RGB.
        view: the virtual camera.

    Returns:
        (height, width, 3) uint8 RGB.
    """
    fine = view.enlarged(_OVERSAMPLING)
    image = np.full((fine.height, fine.width, 3), BACKGROUND, np.uint8)
    _draw_ground_rings(image, fine)
    radius = np.clip(_DISC_PER_M * np.linalg.norm(points[:, :3], axis=1), *_DISC_LIMITS_M)
    splats = splat(points, radius, fine, limits_px=_DISC_LIMITS_PX)
    covered = splats.index != NOTHING
    light = np.prod([shade(splats.depth, reach, strength) for reach, strength in _SHADES], axis=0)
    image[covered] = colours[splats.index[covered]] * light[covered, None]
    return cv2.resize(image, (view.width, view.height), interpolation=cv2.INTER_AREA)


def draw_wires(image: np.ndarray, boxes: Boxes, types: tuple[str, ...], view: Viewpoint) -> None:
    """Draw boxes as wire frames with class and distance above, the nearest named first."""
    corners, distance = boxes.corners, np.linalg.norm(boxes.centre, axis=1)
    near_first = np.argsort(distance, kind="stable")
    for row in near_first[::-1]:
        draw_segments(image, view.wire(corners[row]), class_colour(types[row]))
    placer = LabelPlacer(image, 12)
    for row in near_first:
        uv, _ = view.project(corners[row, 4:].mean(0, keepdims=True))
        if view.inside(uv)[0]:
            text = f"{types[row]} {distance[row]:.0f} m"
            placer.place(text, above(uv[0, 0], uv[0, 1] - 20, step_px=25), class_colour(types[row]))


def _draw_ground_rings(image: np.ndarray, view: Viewpoint) -> None:
    turn = np.linspace(0, 2 * np.pi, 361)
    for radius in range(10, 81, 10):
        ring = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full_like(turn, -LIDAR_HEIGHT_M)], -1)
        draw_segments(image, view.segments(ring[:-1], ring[1:]), GRID, _OVERSAMPLING)
