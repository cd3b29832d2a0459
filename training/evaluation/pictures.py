"""What was detected, drawn on scans from above: labels green, detections orange, the surer the brighter."""

from __future__ import annotations

import base64

import cv2
import numpy as np

from cosim.kitti import Calibration, Drive
from cosim.view.birds_eye import GroundPlan, draw_from_above
from cosim.view.colours import Rgb
from cosim.view.drawing import draw_path, draw_text
from training.evaluation.read import Scored, Table

_PLAN = GroundPlan(reach_m=60.0, size_px=1200)
_LABEL, _FOUND = (96, 220, 130), (255, 178, 62)
_LEAST_SCORE = 0.1
_AHEAD_PX = 640  # rows kept: what lies ahead, and a little behind


def detection_pictures(scored: Scored, drive: Drive, most: int = 4) -> list[tuple[str, str]]:
    """Captions with data URLs of pictures of frames with labels, evenly spread.

    Args:
        scored: labels and detections.
        drive: has the scans.
        most: at most so many.
    """
    busy = np.unique(scored.labels.frame[scored.labels.kind != "dontcare"])
    busy = [int(frame) for frame in busy if scored.names[frame] in drive]
    chosen = [busy[i] for i in np.unique(np.linspace(0, len(busy) - 1, most).round().astype(int))] if busy else []
    return [(f"Frame {scored.names[number]}", _data_url(draw(scored, drive, number))) for number in chosen]


def draw(scored: Scored, drive: Drive, number: int) -> np.ndarray:
    """One frame's part ahead of the sensor, (h, w, 3) uint8 RGB."""
    frame = drive[scored.names[number]]
    brightness = np.clip(70 + 160 * frame.points[:, 3], 0, 255).astype(np.uint8)
    image = draw_from_above(frame.points, np.repeat(brightness[:, None], 3, 1), _PLAN)
    for table, colour in ((scored.labels, _LABEL), (scored.detections, _FOUND)):
        rows = np.flatnonzero((table.frame == number) & (table.kind != "dontcare"))
        _outline(image, table, rows, frame.calibration, colour)
    return image[:_AHEAD_PX]


def _outline(image: np.ndarray, table: Table, rows: np.ndarray, calibration: Calibration, colour: Rgb) -> None:
    boxes, score = table.objects[rows].boxes_velo(calibration), table.objects.score
    for row, corners in zip(rows, boxes.corners[:, :4, :2], strict=True):
        sure = 1.0 if score is None else float(np.clip(score[row], 0, 1))
        if sure < _LEAST_SCORE:
            continue
        red, green, blue = (int(c * (0.35 + 0.65 * sure)) for c in colour)
        shade = (red, green, blue)
        draw_path(image, _PLAN.pixels(corners), shade, 5 if score is None else 2, closed=True)
        front = corners[[0, 3]].mean(0)
        draw_path(image, _PLAN.pixels(np.stack([corners.mean(0), front])), shade, 2)
        if score is not None:
            x, y = _PLAN.pixels(corners).max(0)
            draw_text(image, f"{sure:.2f}", (x + 4, y - 4), 9, shade)


def _data_url(image: np.ndarray) -> str:
    encoded, data = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])
    assert encoded
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode()
