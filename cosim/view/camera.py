"""Draw LiDAR points and labels into camera images."""

from __future__ import annotations

import cv2
import numpy as np

from cosim.drives.kitti import Boxes, Labels
from cosim.view.colours import BACKGROUND, MUTED, Scale, class_colour, dimmed
from cosim.view.drawing import LabelPlacer, above, draw_colour_bar, draw_path, draw_segments
from cosim.view.projection import Viewpoint

ENLARGED = 2
_FOOTER_PX = 62
_BAR_MARGIN_PX = 40
_MIN_TRUNCATION = 0.005  # smaller values are not shown
_OCCLUSION = {0: "visible", 1: "partly occluded", 2: "largely occluded", 3: "occlusion unknown"}


def enlarge(image: np.ndarray) -> np.ndarray:
    """Convert an image (h, w) or (h, w, 3) to RGB and enlarge it by `ENLARGED` in both directions."""
    rgb = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    return cv2.resize(rgb, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)


def draw_points(image: np.ndarray, points: np.ndarray, view: Viewpoint, scale: Scale) -> np.ndarray:
    """Draw LiDAR points on a darkened camera image, coloured by depth, with a colour bar below.

    Args:
        image: (h, w, 3) uint8 RGB image from `enlarge`.
        points: (n, ≥ 3) points in LiDAR axes [m].
        view: view of the camera, enlarged by the same factor.
        scale: colour scale of depth [m].
    """
    drawn = (image * 0.6).astype(np.uint8)
    uv, depth = view.project(points)
    visible = np.flatnonzero(view.inside(uv))
    visible = visible[np.argsort(-depth[visible], kind="stable")]
    for (x, y), colour in zip(np.rint(uv[visible] * 16).astype(int), scale.colours(depth[visible]), strict=True):
        cv2.circle(drawn, (int(x), int(y)), 28, colour.tolist(), -1, cv2.LINE_AA, 4)
    return with_colour_bar(drawn, scale)


def draw_labels(image: np.ndarray, labels: Labels, boxes: Boxes, view: Viewpoint) -> np.ndarray:
    """Draw 2D boxes (thin) and 3D boxes (thick, with a cross on the front) with class, occlusion and truncation.

    Args:
        image: (h, w, 3) uint8 RGB image from `enlarge`.
        labels: n objects and any number of `DontCare` regions, which are drawn thin and gray.
        boxes: n boxes of the objects in LiDAR axes.
        view: view of the camera, enlarged by the same factor.
    """
    drawn = image.copy()
    for region in labels.of_type("DontCare").bbox:
        draw_path(drawn, _rectangle(region), MUTED, 1, closed=True)
    objects = labels.cared_for
    truncation = objects.truncation
    far_first = np.argsort(-np.linalg.norm(boxes.centre, axis=1), kind="stable")
    for row in far_first:
        colour, corners = class_colour(objects.type[row]), boxes.corners[row]
        draw_path(drawn, _rectangle(objects.bbox[row]), dimmed(colour, 0.75), 1, closed=True)
        draw_segments(drawn, view.wire(corners), colour, 2)
        # front face: corners 0 and 3 below, 4 and 7 above
        draw_segments(drawn, view.segments(corners[[0, 3]], corners[[7, 4]]), colour, 1)
    placer = LabelPlacer(drawn, 14)
    for row in far_first[::-1]:
        left, top, right, _ = objects.bbox[row] * ENLARGED
        text = f"{objects.type[row]}, {_OCCLUSION.get(int(objects.occluded[row]), 'occlusion not given')}"
        if truncation[row] >= _MIN_TRUNCATION:
            text += f", {100 * truncation[row]:.0f}% cut off"
        middle = (left + right) / 2
        placer.place(text, above(middle, top - 18, step_px=29), class_colour(objects.type[row]))
    return drawn


def with_colour_bar(image: np.ndarray, scale: Scale) -> np.ndarray:
    """Add a strip with a colour bar below an image."""
    strip = np.full((_FOOTER_PX, image.shape[1], 3), BACKGROUND, np.uint8)
    width = min(600, image.shape[1] - 2 * _BAR_MARGIN_PX)
    if width > 0:
        draw_colour_bar(strip, scale, (image.shape[1] - width - _BAR_MARGIN_PX, 24), (width, 14))
    return np.concatenate([image, strip])


def draw_depth(depth_m: np.ndarray, scale: Scale) -> np.ndarray:
    """Draw a depth image (h, w) [m] in colours (black without a surface), with a colour bar below."""
    colours = scale.colours(depth_m)
    colours[depth_m <= 0] = 0
    return with_colour_bar(cv2.resize(colours, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_NEAREST), scale)


def _rectangle(bbox: np.ndarray) -> np.ndarray:
    """Corners of a 2D box (4,) on the enlarged image, (4, 2)."""
    left, top, right, bottom = bbox * ENLARGED + (ENLARGED - 1) / 2
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
