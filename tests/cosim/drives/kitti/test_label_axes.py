"""Whether boxes are upright in camera or in LiDAR axes is inferred from the points of the objects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.drives.kitti import Calibration, Drive, Labels, write_calibration, write_labels, write_points
from cosim.drives.kitti.boxes import Boxes
from cosim.drives.kitti.label_axes import in_camera_axes, infer_label_axes, upright_in_lidar
from cosim.errors import DriveError
from tests.cosim.drives.kitti.conftest import CALIBRATION

_TILT = np.radians(7.0)


def tilted(angle_rad: float = _TILT) -> Calibration:
    """A camera that looks down by an angle."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    turn = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    return replace(CALIBRATION, R0_rect=np.eye(3), Tr_velo_to_cam=turn @ CALIBRATION.Tr_velo_to_cam)


def surfaces(lengths_m: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (n, 3), yaws (n,) and points (n, k, 3) in box axes, of objects with points on their sides and roof."""
    count = len(lengths_m)
    centres = np.column_stack([12.0 + 7 * np.arange(count), rng.uniform(-3, 3, count), np.full(count, -0.9)])
    points = rng.uniform(-0.5, 0.5, (count, 400, 3))
    points[:, :150, 0], points[:, 150:300, 1], points[:, 300:, 2] = -0.5, 0.5, 0.5
    return centres, rng.uniform(-0.4, 0.4, count), points


def example(axes: str, calibration: Calibration, seed: int = 0, names: str = "Car") -> tuple[Labels, np.ndarray]:
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(1.5, 5.0, 12)
    sizes = np.column_stack([lengths, np.full(12, 1.8), np.full(12, 1.5)])
    centres, yaws, points = surfaces(lengths, rng)
    labels = Labels.from_boxes(Boxes(centres, sizes, yaws), [names] * 12, calibration)
    if axes == "lidar":
        bottom = centres - [0, 0, 0.75]
        labels = replace(labels, location=calibration.velo_to_rect(bottom), rotation_y=-yaws - np.pi / 2)
    world = []
    for row in range(12):
        cos, sin = np.cos(yaws[row]), np.sin(yaws[row])
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
        if axes == "camera":
            rotation = calibration.rect_to_velo_matrix[:3, :3]
            heading = labels.rotation_y[row]
            ahead, up = rotation @ [np.cos(heading), 0, -np.sin(heading)], -rotation[:, 1]
            turn = np.column_stack([ahead, np.cross(up, ahead), up])
            base = calibration.rect_to_velo(labels.location[row : row + 1])[0]
            middle = base + turn @ [0, 0, 0.75]
        else:
            middle = centres[row]
        world.append((points[row] * sizes[row] * 0.995) @ turn.T + middle)
    return labels, np.concatenate(world)


@pytest.mark.parametrize("axes", ["camera", "lidar"])
@pytest.mark.parametrize("seed", range(3))
def test_points_decide_where_the_camera_is_tilted(axes, seed):
    calibration = tilted()
    labels, points = example(axes, calibration, seed)
    found, why = infer_label_axes([(labels, calibration, points)])
    assert found == axes and why.startswith(f"label_axes: {axes}, since the camera is tilted by 7.0°")


def test_without_tilt_there_is_no_question():
    labels, points = example("lidar", tilted(0.01))
    assert infer_label_axes([(labels, tilted(0.01), points)]) == ("camera", "")


def test_names_of_view_of_delft_do_not_decide_against_the_points():
    calibration = tilted()
    labels, points = example("camera", calibration, names="bicycle_rack")
    assert infer_label_axes([(labels, calibration, points)])[0] == "camera"


def test_without_objects_the_standard_is_assumed_and_said():
    labels, points = example("lidar", tilted())
    found, why = infer_label_axes([(labels[:3], tilted(), points)])
    assert found == "camera" and "3 labelled objects are too few" in why and "label_axes: lidar" in why


def test_labels_are_converted_to_the_convention_of_kitti():
    calibration = tilted()
    labels, _ = example("lidar", calibration)
    boxes, expected = in_camera_axes(labels, calibration).boxes_velo(calibration), upright_in_lidar(labels, calibration)
    np.testing.assert_allclose(boxes.centre, expected.centre, atol=1e-9)
    np.testing.assert_allclose(np.cos(boxes.yaw - expected.yaw), 1.0)


def drive_of(folder: Path, axes: str) -> Path:
    calibration = tilted()
    labels, points = example(axes, calibration)
    for part in ("velodyne", "calib", "label_2"):
        (folder / part).mkdir(parents=True)
    rng = np.random.default_rng(1)
    ground = np.column_stack([rng.uniform(3, 60, 4000), rng.uniform(-20, 20, 4000), np.full(4000, -1.7)])
    cloud = np.concatenate([points, ground])
    write_points(folder / "velodyne/000000.bin", np.column_stack([cloud, np.full(len(cloud), 0.4)]))
    write_calibration(folder / "calib/000000.txt", calibration)
    write_labels(folder / "label_2/000000.txt", labels, 6)
    return folder


def test_a_drive_reads_its_labels_in_the_inferred_axes(tmp_path):
    drive = Drive(drive_of(tmp_path, "lidar"))
    assert drive.label_axes[0] == "lidar" and drive.label_axes[1] in drive.notes()
    labels, _ = example("lidar", tilted())
    boxes = drive["000000"].labels.boxes_velo(drive["000000"].calibration)
    np.testing.assert_allclose(boxes.centre, upright_in_lidar(labels, tilted()).centre, atol=1e-4)


@pytest.mark.parametrize("stated", ["camera", "lidar"])
def test_a_statement_goes_before(stated, tmp_path):
    folder = drive_of(tmp_path, "camera" if stated == "lidar" else "lidar")
    (folder / "drive.yaml").write_text(f"label_axes: {stated}\n")
    assert Drive(folder)["000000"].label_axes == stated
    (folder / "drive.yaml").write_text("label_axes: up\n")
    with pytest.raises(DriveError, match="label_axes is 'up'; write camera or lidar"):
        _ = Drive(folder)["000000"]
