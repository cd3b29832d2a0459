"""Draw one frame of several variants side by side, optionally with a measured frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from cosim.drives.kitti import Drive
from cosim.drives.kitti.frame import Frame
from cosim.drives.writer import explained
from cosim.view.birds_eye import GroundPlan, draw_outlines
from cosim.view.colours import BACKGROUND, MUTED, TEXT, Scale
from cosim.view.drawing import draw_colour_bar, draw_text
from cosim.view.perspective import chase_view, close_view, draw_perspective
from cosim.view.projection import Viewpoint
from cosim.view.selection import choose_frames

_SCALE = Scale("", 0.0, 1.0, map="viridis", start=0.12)
_STREET_PX, _CAR_PX, _PLAN_PX = (900, 420), (450, 320), (450, 320)
_GAP_PX, _TITLE_PX = 10, 40
_PLAN_REACH_M = 5.0
_COLUMNS = 3
_VEHICLES = ("car", "van", "truck")
_CAR_RANGE_M = (5.0, 30.0)


def write_picture(path: Path, folders: Sequence[Path], *, frame: str | None = None, beside: Path | None = None) -> None:
    """Draw one frame of every variant: the street, one nearby car, and that car from above with its boxes.

    Args:
        path: PNG file to write.
        folders: folders of the variants' drives, which have the same frames.
        frame: name of the frame; None: a frame with large objects.
        beside: measured drive, of which a frame with large objects is also drawn.

    Raises:
        CosimError: the frame does not exist, a drive is damaged, or the file cannot be written.
    """
    drives = [Drive(folder) for folder in folders]
    name = frame or choose_frames(drives[0], "1")[0]
    frames = [(drive.root.name, drive[name]) for drive in drives]
    if beside is not None:
        measured = Drive(beside)
        chosen = choose_frames(measured, "1")[0]
        frames.append((f"measured: {measured.root.name}", measured[chosen]))
    panels = [_draw_panel(title, item) for title, item in frames]
    empty = np.full_like(panels[0], BACKGROUND, np.uint8)
    panels += [empty] * (-len(panels) % _COLUMNS)
    rows = [np.hstack(panels[start : start + _COLUMNS]) for start in range(0, len(panels), _COLUMNS)]
    image = np.vstack(rows)
    is_encoded, data = cv2.imencode(".png", image[..., ::-1])
    assert is_encoded  # encoding an 8-bit image to memory does not fail
    with explained(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data.tobytes())


def _draw_panel(title: str, frame: Frame) -> np.ndarray:
    points = frame.points
    colours = _SCALE.colours(points[:, 3])
    street = draw_perspective(points, colours, chase_view(*_STREET_PX))
    close, plan = _draw_car(frame, points, colours)
    body = np.vstack([street, np.hstack([close, plan])])
    height, width = body.shape[0] + _TITLE_PX + _GAP_PX, body.shape[1] + _GAP_PX
    panel = np.full((height, width, 3), BACKGROUND, np.uint8)
    panel[_TITLE_PX : _TITLE_PX + body.shape[0], : body.shape[1]] = body
    draw_text(panel, title, (8, 10), 15, TEXT)
    summary = f"{len(points):,} points, mean intensity {points[:, 3].mean():.2f}"
    draw_text(panel, summary, (width - _GAP_PX - 320, 12), 11, MUTED, (1, 0))
    draw_colour_bar(panel, _SCALE, (width - _GAP_PX - 300, 12), (280, 10))
    return panel


def _draw_car(frame: Frame, points: np.ndarray, colours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Draw the nearest clearly visible vehicle in a close-up, and from above with its label and its exact box."""
    width, height = _CAR_PX
    blank = np.full((height, width, 3), BACKGROUND, np.uint8)
    exact = frame.exact_labels.cared_for
    is_vehicle = np.array([kind.lower() in _VEHICLES for kind in exact.type], bool)
    exact = exact[is_vehicle & (exact.occluded <= 1)]
    if not len(exact):
        return blank, blank
    boxes = exact.boxes_velo(frame.calibration)
    distance = np.hypot(boxes.centre[:, 0], boxes.centre[:, 1])
    low, high = _CAR_RANGE_M
    row = int(np.argmin(np.where((distance >= low) & (distance <= high), distance, distance + 1e3)))
    view: Viewpoint = close_view(boxes, row, width, height)
    close = draw_perspective(points, colours, view)
    draw_text(close, f"{exact.type[row]} at {distance[row]:.0f} m", (8, 8), 11, TEXT)
    centre = boxes.centre[row]
    plan = GroundPlan(_PLAN_REACH_M, max(_PLAN_PX))
    moved = points[:, :3] - centre.astype(np.float32)
    on_it = (np.abs(moved[:, 2]) < boxes.size[row, 2] / 2 - 0.15) & (np.abs(moved[:, :2]) < _PLAN_REACH_M - 0.1).all(1)
    from_above = np.full((plan.size_px, plan.size_px, 3), BACKGROUND, np.uint8)
    for (x, y), colour in zip(np.rint(plan.pixels(moved[on_it])).astype(int), colours[on_it], strict=True):
        cv2.circle(from_above, (int(x), int(y)), 1, colour.tolist(), -1, cv2.LINE_AA)
    labels = frame.labels.cared_for
    for group, thickness in ((exact, 1), (labels, 2)):
        outlines = group.boxes_velo(frame.calibration)
        near = np.hypot(*(outlines.centre - centre)[:, :2].T) < 2 * _PLAN_REACH_M
        local = type(outlines)(outlines.centre[near] - centre, outlines.size[near], outlines.yaw[near])
        types = tuple(
            "other" if thickness == 1 else kind for kind, is_near in zip(group.type, near, strict=True) if is_near
        )
        draw_outlines(from_above, local, types, plan, thickness)
    cut = (from_above.shape[0] - height) // 2
    from_above = from_above[cut : cut + height]
    draw_text(from_above, "thin: exact box, thick: label", (8, 8), 11, TEXT)
    return close, from_above
