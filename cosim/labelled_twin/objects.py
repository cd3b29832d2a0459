"""Convert labelled boxes to posed models."""

from __future__ import annotations

import numpy as np

from assets import MATERIALS
from cosim.drives.kitti import Boxes, Calibration, Labels
from cosim.drives.kitti.label_axes import LabelAxes
from cosim.drives.twin import Instance
from cosim.scene.bridge import models_of_size

KINDS = {name: name for name in ("car", "van", "truck", "tram", "pedestrian", "person_sitting", "cyclist")}
_PAINT = MATERIALS["car_paint"].reflectance


def label_instances(
    labels: Labels, calibration: Calibration, world_from_lidar: np.ndarray, axes: LabelAxes = "camera"
) -> tuple[tuple[Instance, ...], int]:
    """Create one instance per labelled object of a class that has models.

    Boxes are upright in the camera's axes, as in KITTI, and their tilt relative to the LiDAR is kept, or in LiDAR axes.
    Labels contain neither motion nor paint: instances are at rest, and their paint is the default of the material
    table.

    Args:
        labels: labels of the frame without DontCare regions.
        calibration: calibration of the frame.
        world_from_lidar: (4, 4) pose of the LiDAR in the world.
        axes: axes in which the boxes are upright.

    Returns:
        The instances, and the number of objects without a model.
    """
    world_from_camera = world_from_lidar @ calibration.rect_to_velo_matrix
    # KITTI's calibration is a rotation only to six digits; project it onto the rotations.
    left, _, right = np.linalg.svd(world_from_camera[:3, :3])
    rotation = left @ right
    instances, without_model = [], 0
    for row, name in enumerate(labels.type):
        height, width, length = labels.dimensions[row]
        kind = KINDS.get(name.lower())
        if kind is None or min(height, width, length) <= 0:
            without_model += 1
            continue
        size = np.array([length, width, height])
        spec = models_of_size(kind, size)[0]
        pose = np.eye(4)
        pose[:3, :3] = rotation @ _camera_from_box(float(labels.rotation_y[row]))
        pose[:3, 3] = world_from_camera[:3, :3] @ labels.location[row] + world_from_camera[:3, 3]
        if axes == "lidar":
            pose = world_from_lidar @ _lidar_from_box(labels[row : row + 1].boxes_velo(calibration))
        instances.append(
            Instance(
                id=f"{name.lower()}{row}",
                kind=kind,
                model=spec.name,
                pose=pose,
                velocity_mps=np.zeros(3),
                yaw_rate_radps=0.0,
                length_m=float(length),
                width_m=float(width),
                height_m=float(height),
                scale=size / np.array(spec.size_m),
                paint=_PAINT,
            )
        )
    return tuple(instances), without_model


def _lidar_from_box(box: Boxes) -> np.ndarray:
    """Pose (4, 4) in LiDAR axes of the bottom centre of one upright box."""
    cos, sin = float(np.cos(box.yaw[0])), float(np.sin(box.yaw[0]))
    pose = np.array([[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], float)
    pose[:3, 3] = box.centre[0] - np.array([0, 0, box.size[0, 2] / 2])
    return pose


def _camera_from_box(rotation_y: float) -> np.ndarray:
    """Rotation (3, 3) from an upright box (x forward, y left, z up) to the camera (x right, y down, z forward)."""
    forward = np.array([np.cos(rotation_y), 0, -np.sin(rotation_y)])
    up = np.array([0.0, -1.0, 0.0])
    return np.column_stack([forward, np.cross(up, forward), up])
