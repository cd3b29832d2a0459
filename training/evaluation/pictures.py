"""Draw detections on scans from above: hits, false detections and missed objects."""

from __future__ import annotations

import base64

import cv2
import numpy as np

from cosim.drives.kitti import Calibration, Drive
from cosim.view.birds_eye import GroundPlan, draw_from_above
from cosim.view.colours import Rgb
from cosim.view.drawing import draw_path, draw_text
from training.data.frame import in_view
from training.evaluation.candidates import overlapping
from training.evaluation.read import Scored, ScoreTable
from training.evaluation.rules import MIN_OVERLAP

CAPTION = (
    "Labels green, those of other classes gray. Detections with scores from 0.3: orange if their 3D overlap with an "
    "object is sufficient for KITTI, otherwise red."
)
_PLAN = GroundPlan(reach_m=60.0, size_px=1680)
_AHEAD_M, _BEHIND_M, _ASIDE_M = 56.0, 3.0, 31.0  # drawn region: KITTI labels no objects beyond that count
_LABEL, _OTHER, _FITS, _MISSES = (96, 220, 130), (120, 126, 138), (255, 178, 62), (240, 84, 84)
_LEAST_SCORE = 0.3
_MIN_OBJECTS = 3  # minimum number of objects in a picture
_OUTSIDE_BRIGHTNESS = 0.4  # brightness of points outside the image


def detection_pictures(scored: Scored, drive: Drive, most: int = 4) -> list[tuple[str, str]]:
    """Captions with data URLs of pictures of frames with several objects, evenly spread.

    Args:
        scored: labels and detections.
        drive: drive with the scans.
        most: at most so many.
    """
    is_searched = scored.labels.frame[np.isin(scored.labels.kind, _searched_classes(scored))]
    counts = np.bincount(is_searched, minlength=len(scored.names))
    in_drive = np.array([name in drive for name in scored.names], bool)
    candidates = np.flatnonzero(in_drive & (counts >= min(_MIN_OBJECTS, counts[in_drive].max(initial=1))))
    chosen = (
        candidates[np.unique(np.linspace(0, len(candidates) - 1, most).round().astype(int))] if len(candidates) else []
    )
    return [(f"Frame {scored.names[number]}", _data_url(draw(scored, drive, int(number)))) for number in chosen]


def draw(scored: Scored, drive: Drive, number: int) -> np.ndarray:
    """One frame's part ahead of the sensor, (h, w, 3) uint8 RGB. Detections below a score of 0.3 are left out."""
    frame = drive[scored.names[number]]
    labels, detections = scored.labels, scored.detections
    seen = np.where(in_view(frame, frame.points), 1.0, _OUTSIDE_BRIGHTNESS)
    brightness = np.clip((80 + 160 * frame.points[:, 3]) * seen, 0, 255).astype(np.uint8)
    image = draw_from_above(frame.points, np.repeat(brightness[:, None], 3, 1), _PLAN)
    objects = np.flatnonzero((labels.frame == number) & (labels.kind != "dontcare"))
    is_searched = np.isin(labels.kind[objects], _searched_classes(scored))
    _draw_outlines(image, labels, objects[~is_searched], frame.calibration, _OTHER, 1)
    _draw_outlines(image, labels, objects[is_searched], frame.calibration, _LABEL, 5)
    score = np.ones(len(detections.frame)) if detections.objects.score is None else detections.objects.score
    detected = np.flatnonzero((detections.frame == number) & (score >= _LEAST_SCORE))
    is_hit = np.isin(detected, _find_hits(scored, objects, detected))
    for rows, colour in ((detected[~is_hit], _MISSES), (detected[is_hit], _FITS)):
        _draw_outlines(image, detections, rows, frame.calibration, colour, 2)
        _draw_scores(image, detections, rows, frame.calibration, score, colour)
    left, top = _PLAN.pixels(np.array([_AHEAD_M, _ASIDE_M])).astype(int)
    right, bottom = _PLAN.pixels(np.array([-_BEHIND_M, -_ASIDE_M])).astype(int)
    return image[top:bottom, left:right]


def _searched_classes(scored: Scored) -> list[str]:
    """Classes of the detections, or all scored classes if there are no detections."""
    scorable = {name.lower() for name in MIN_OVERLAP}
    return sorted(scorable & set(scored.detections.kind) or scorable)


def _find_hits(scored: Scored, objects: np.ndarray, detected: np.ndarray) -> np.ndarray:
    """Rows of detections whose overlap with an object of their class is sufficient for KITTI."""
    rows = [np.zeros(0, np.int64)]
    for name, least in MIN_OVERLAP.items():
        class_objects = objects[scored.labels.kind[objects] == name.lower()]
        class_detections = detected[scored.detections.kind[detected] == name.lower()]
        rows.append(overlapping(scored, class_objects, class_detections, "3d", least).detection)
    return np.concatenate(rows)


def _draw_outlines(
    image: np.ndarray, table: ScoreTable, rows: np.ndarray, calibration: Calibration, colour: Rgb, thickness: int
) -> None:
    for corners in table.objects[rows].boxes_velo(calibration).corners[:, :4, :2]:
        draw_path(image, _PLAN.pixels(corners), colour, thickness, closed=True)
        front = corners[[0, 3]].mean(0)
        draw_path(image, _PLAN.pixels(np.stack([corners.mean(0), front])), colour, min(thickness, 2))


def _draw_scores(
    image: np.ndarray, table: ScoreTable, rows: np.ndarray, calibration: Calibration, score: np.ndarray, colour: Rgb
) -> None:
    for row, corners in zip(rows, table.objects[rows].boxes_velo(calibration).corners[:, :4, :2], strict=True):
        x, y = _PLAN.pixels(corners).max(0)
        draw_text(image, f"{score[row]:.2f}", (x + 4, y - 4), 10, colour)


def _data_url(image: np.ndarray) -> str:
    encoded, data = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])
    assert encoded
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode()
