"""Labels, calibration and points agree with each other and with the public development kit's conventions.

The reader below follows those conventions with plain numpy; it shares nothing with the library.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.drives.kitti import (
    Boxes,
    Calibration,
    Drive,
    Frame,
    Labels,
    box_areas,
    clip_boxes,
    points_in_boxes,
    project_corners,
)


def _plain_objects(file: Path) -> list[tuple[str, np.ndarray]]:
    lines = [line.rstrip().split(" ") for line in file.read_text().splitlines()]
    return [(words[0], np.array(words[1:], float)) for words in lines]


def _plain_calibration(file: Path) -> dict[str, np.ndarray]:
    lines = [line.split(":", 1) for line in file.read_text().splitlines() if ":" in line]
    return {key: np.array(rest.split(), float) for key, rest in lines}


def _plain_corners(values: np.ndarray) -> np.ndarray:
    """(3, 8) in camera axes, as computeBox3D.m."""
    h, w, length, (x, y, z), ry = values[7], values[8], values[9], values[10:13], values[13]
    turn = np.array([[np.cos(ry), 0, np.sin(ry)], [0, 1, 0], [-np.sin(ry), 0, np.cos(ry)]])
    xs = np.array([1, 1, -1, -1, 1, 1, -1, -1]) * length / 2
    ys = np.array([0, 0, 0, 0, -1, -1, -1, -1]) * h
    zs = np.array([1, -1, -1, 1, 1, -1, -1, 1]) * w / 2
    return turn @ np.stack([xs, ys, zs]) + np.array([[x], [y], [z]])


def _iou(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    shared = np.concatenate([np.maximum(a[:, :2], b[:, :2]), np.minimum(a[:, 2:], b[:, 2:])], 1)
    return box_areas(shared) / (box_areas(a) + box_areas(b) - box_areas(shared))


def _check_against_plain_reader(frame: Frame) -> None:
    objects = _plain_objects(frame.path("label_2"))
    matrices = _plain_calibration(frame.path("calib"))
    points = np.fromfile(str(frame.path("velodyne")), dtype=np.float32).reshape(-1, 4)
    assert np.array_equal(frame.points, points)
    labels = frame.labels
    assert labels.type == tuple(name for name, _ in objects)
    corners = np.array([_plain_corners(values).T for _, values in objects])
    assert np.allclose(labels.corners_rect, corners)
    assert np.allclose(labels.bbox, [values[3:7] for _, values in objects])
    rect = (
        matrices["R0_rect"].reshape(3, 3)
        @ matrices["Tr_velo_to_cam"].reshape(3, 4)
        @ np.c_[points[:, :3], np.ones(len(points))].T
    )
    assert np.allclose(frame.calibration.velo_to_rect(points), rect.T, atol=1e-6)
    image = matrices["P2"].reshape(3, 4) @ np.vstack([rect, np.ones(len(points))])
    uv, depth = frame.calibration.project(points)
    assert np.allclose(depth, image[2], atol=1e-6)
    ahead = image[2] > 0.5
    assert np.allclose(uv[ahead], (image[:2] / image[2]).T[ahead], atol=1e-3)


def test_real_frames_are_read_equally_through_the_plain_reader(kitti_root: Path) -> None:
    for frame in Drive(kitti_root):
        _check_against_plain_reader(frame)


def test_simulated_frames_are_read_equally_through_the_plain_reader(drive_root: Path) -> None:
    for frame in Drive(drive_root):
        _check_against_plain_reader(frame)


def test_real_cars_project_onto_their_2d_boxes(kitti_root: Path) -> None:
    seen = 0
    for frame in Drive(kitti_root):
        height, width = frame.image().shape[:2]
        cars = frame.labels.of_type("Car")
        cars = cars[cars.truncated == 0]
        projected = project_corners(cars.corners_rect, frame.calibration.projection(2))
        assert (_iou(clip_boxes(projected, width, height), cars.bbox) > 0.7).all()
        seen += len(cars)
    assert seen > 0


def test_real_visible_cars_hold_points_and_far_fewer_lie_just_above_them(kitti_root: Path) -> None:
    for frame in Drive(kitti_root):
        cars = frame.labels.of_type("Car")
        cars = cars[(cars.occluded == 0) & (cars.truncated < 0.15) & (cars.location[:, 2] < 40)]
        boxes = cars.boxes_velo(frame.calibration)
        inside = points_in_boxes(frame.points, boxes).sum(1)
        above = Boxes(boxes.centre + [0, 0, 1] * boxes.size, boxes.size, boxes.yaw)
        assert (inside > 10).all()
        assert points_in_boxes(frame.points, above).sum() < 0.2 * inside.sum() or not len(cars)


def test_real_labels_survive_the_way_to_the_lidar_and_back(kitti_root: Path) -> None:
    for frame in Drive(kitti_root):
        labels = frame.labels.cared_for
        boxes = labels.boxes_velo(frame.calibration)
        back = Labels.from_boxes(boxes, labels.type, frame.calibration)
        assert np.allclose(back.location, labels.location, atol=1e-9)
        assert np.allclose(back.dimensions, labels.dimensions)
        assert np.allclose(np.cos(back.rotation_y - labels.rotation_y), 1, atol=1e-6)
        assert np.allclose(np.cos(back.alpha - labels.alpha), 1, atol=1e-3)


P2 = np.array([[700, 0, 600, 0], [0, 700, 170, 0], [0, 0, 1, 0]], float)


@given(st.floats(-20, 20), st.floats(6, 60), st.floats(-np.pi, np.pi))
def test_a_box_wholly_ahead_projects_to_the_extent_of_its_corners(x: float, z: float, turn: float) -> None:
    labels = Labels(("Car",), *np.zeros((3, 1)), np.zeros((1, 4)), [[1.5, 1.7, 4]], [[x, 1.7, z]], [turn])
    calibration = Calibration(P2=P2, R0_rect=np.eye(3), Tr_velo_to_cam=np.eye(4)[:3])
    uv, _ = calibration.project_rect(labels.corners_rect[0])
    box = project_corners(labels.corners_rect, P2)[0]
    assert np.allclose(box, [*uv.min(0), *uv.max(0)])


def test_a_box_next_to_the_camera_reaches_the_edge_of_the_image_and_one_behind_is_nowhere() -> None:
    beside, behind = [3, 1.7, 0.5], [3, 1.7, -9]
    sizes = [[1.5, 1.7, 4]] * 2
    labels = Labels(("Car",) * 2, *np.zeros((3, 2)), np.zeros((2, 4)), sizes, [beside, behind], [np.pi / 2] * 2)
    boxes = project_corners(labels.corners_rect, P2)
    left, _, right, _ = clip_boxes(boxes, 1242, 375)[0]
    assert left == pytest.approx(600 + 700 * (3 - 0.85) / 2.5)
    assert right == 1241
    assert np.isnan(boxes[1]).all()
