"""Axis about which labelled boxes are upright: the camera's y axis, as KITTI defines, or the LiDAR's z axis.

View-of-Delft has KITTI's format, but defines the rotation about the LiDAR's negative z axis (docs/ANNOTATION.md). The
two readings differ where the camera is tilted against the LiDAR. Boxes are upright in LiDAR axes if two clues agree:
the names of classes are those of that data set, and the points fit such boxes better. Without such names the points
decide: the share of an object's points that are inside has to be clearly higher, and the number above its top
not higher.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

import numpy as np

from cosim.drives.kitti.boxes import Boxes
from cosim.drives.kitti.calibration import Calibration
from cosim.drives.kitti.labels import DONT_CARE, Labels

LabelAxes = Literal["camera", "lidar"]
AXES: tuple[LabelAxes, ...] = ("camera", "lidar")
_DELFT = {"bicycle_rack", "moped_scooter", "human_depiction", "ride_other", "ride_uncertain", "vehicle_other"}
_TILTED_DEG = 2.0  # below, the readings are almost equal
_GROUND_M, _SHELL_M, _ABOVE_M = 0.1, 0.15, 0.3
_FEWEST_POINTS, _FEWEST_OBJECTS = 20, 8
_CERTAIN = 3.0  # standard errors of the mean difference
_ABOVE_RATIO = 0.8  # points above the top under the right reading, over those under the other


def is_tilted(calibration: Calibration) -> bool:
    """Whether camera and LiDAR are tilted against each other so much that the readings differ."""
    return _tilt_deg(calibration) >= _TILTED_DEG


def _tilt_deg(calibration: Calibration) -> float:
    """Angle between the camera's vertical axis and that of the LiDAR [deg]."""
    up = -calibration.rect_to_velo_matrix[:3, 1]
    return float(np.degrees(np.arccos(np.clip(up[2] / np.linalg.norm(up), -1, 1))))


def upright_in_lidar(labels: Labels, calibration: Calibration) -> Boxes:
    """Boxes (LiDAR axes) of labels whose boxes are upright in LiDAR axes and rotate about −z."""
    centre = calibration.rect_to_velo(labels.location) + np.array([0, 0, 0.5]) * labels.dimensions[:, :1]
    return Boxes(centre, labels.dimensions[:, ::-1], -labels.rotation_y - np.pi / 2)


def in_camera_axes(labels: Labels, calibration: Calibration) -> Labels:
    """Labels in KITTI's convention, whose `boxes_velo` are those of labels that are upright in LiDAR axes."""
    plain = np.array([name.lower() == DONT_CARE.lower() for name in labels.type], bool)
    boxes = upright_in_lidar(labels, calibration)
    turned = Labels.from_boxes(boxes, labels.type, calibration)
    # the direction in the camera's horizontal plane that lies above or below the heading
    ahead = np.linalg.solve(
        calibration.rect_to_velo_matrix[:2, [0, 2]], np.stack([np.cos(boxes.yaw), np.sin(boxes.yaw)])
    )
    rotation_y = np.where(plain, labels.rotation_y, np.arctan2(-ahead[1], ahead[0]))
    return replace(labels, location=np.where(plain[:, None], labels.location, turned.location), rotation_y=rotation_y)


def infer_label_axes(
    frames: Iterable[tuple[Labels, Calibration, np.ndarray]],
) -> tuple[LabelAxes, str]:
    """The axis of labels, and the evidence in one sentence; empty where the readings are almost equal.

    Args:
        frames: labels without DontCare regions, calibration, and points (n, ≥ 3) in LiDAR axes of some frames.
    """
    rows, tilt, classes = [], 0.0, set[str]()
    for labels, calibration, points in frames:
        classes |= {name.lower() for name in labels.type}
        tilt = max(tilt, _tilt_deg(calibration))
        if not is_tilted(calibration):
            continue
        for row in _apart(labels):
            one = labels[row : row + 1]
            sides = np.array([_counts(points, *pose, one.dimensions[0]) for pose in _poses(one, calibration)])
            if (sides[:, 1] >= _FEWEST_POINTS).all():
                rows.append(sides)
    if tilt < _TILTED_DEG:
        return "camera", ""
    tilted = f"the camera is tilted by {tilt:.1f}° against the LiDAR"
    if len(rows) < _FEWEST_OBJECTS:
        return "camera", (
            f"{tilted}, and {len(rows)} labelled objects are too few to test whether boxes are upright in camera or "
            "LiDAR axes: camera axes are assumed, as KITTI defines; write label_axes: lidar to drive.yaml otherwise"
        )
    inside, around, over = np.moveaxis(np.array(rows), 2, 0)  # (objects, readings) each
    (camera, lidar), above = inside.sum(0) / around.sum(0), over.sum(0)
    evidence = (
        f"{tilted}; {lidar:.1%} of the points in or next to labelled objects are inside boxes upright in LiDAR axes, "
        f"{camera:.1%} in camera axes, and {above[1]:.0f} against {above[0]:.0f} are above them ({len(rows)} objects)"
    )
    gain = _gain(inside, around)
    fewer = [above[one] <= _ABOVE_RATIO * above[1 - one] for one in (0, 1)]
    named = sorted(classes & _DELFT)
    if named and lidar > camera and fewer[1]:
        return "lidar", f"label_axes: lidar, as in View-of-Delft, whose class {named[0]!r} is there, and {evidence}"
    if not named and gain > _CERTAIN and fewer[1]:
        return "lidar", f"label_axes: lidar, since {evidence}"
    if gain < -_CERTAIN and fewer[0]:
        return "camera", f"label_axes: camera, since {evidence}"
    return "camera", (
        f"label_axes: camera is assumed, as KITTI defines, since the points do not decide: {evidence}; write "
        "label_axes: lidar to drive.yaml otherwise"
    )


def _gain(inside: np.ndarray, around: np.ndarray) -> float:
    """Mean gain of the share inside by the second reading, over objects, in standard errors."""
    gains = inside[:, 1] / around[:, 1] - inside[:, 0] / around[:, 0]
    return float(gains.mean() / max(gains.std(ddof=1) / np.sqrt(len(gains)), 1e-9))


def _apart(labels: Labels) -> list[int]:
    """Objects without another one so near that its points would be counted."""
    ground = labels.location[:, [0, 2]]
    reach = np.hypot(labels.dimensions[:, 1], labels.dimensions[:, 2]) / 2 + _SHELL_M
    away = np.linalg.norm(ground[:, None] - ground, axis=2) - reach[:, None] - reach
    np.fill_diagonal(away, np.inf)
    return np.flatnonzero((away > 0).all(1)).tolist()


def _poses(one: Labels, calibration: Calibration) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rotation (3, 3) from box to LiDAR axes and bottom centre [m] of one object, under both readings."""
    bottom = calibration.rect_to_velo(one.location)[0]
    rotation, heading = calibration.rect_to_velo_matrix[:3, :3], float(one.rotation_y[0])
    up = -rotation[:, 1]
    ahead = rotation @ np.array([np.cos(heading), 0, -np.sin(heading)])
    yaw = -heading - np.pi / 2
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
    return [(np.column_stack([ahead, np.cross(up, ahead), up]), bottom), (turned, bottom)]


def _counts(points: np.ndarray, rotation: np.ndarray, bottom: np.ndarray, dimensions: np.ndarray) -> np.ndarray:
    """Points inside a box, within its shell, and above its top."""
    height, width, length = dimensions
    reach = np.hypot(length, width) / 2 + 1
    xyz = points[:, :3].astype(np.float64)
    near = xyz[(np.abs(xyz[:, :2] - bottom[:2]) < reach).all(1)]
    local = (near - bottom) @ rotation
    aside, up = np.abs(local[:, :2]), local[:, 2]
    half = np.array([length, width]) / 2
    within, around = (aside < half).all(1), (aside < half + _SHELL_M).all(1)
    inside = within & (up > _GROUND_M) & (up < height)
    shell = around & (up > _GROUND_M) & (up < height + _SHELL_M)
    above = within & (up >= height) & (up < height + _ABOVE_M)
    return np.array([inside.sum(), shell.sum(), above.sum()], float)
