"""From labelled boxes to posed models."""

from __future__ import annotations

import numpy as np

from assets import MATERIALS
from cosim.drives.kitti import Calibration, Labels
from cosim.drives.twin import Instance
from cosim.scene.bridge import models_of_size

KINDS = {"car": "car", "van": "van", "truck": "truck", "pedestrian": "pedestrian", "cyclist": "cyclist"}
_PAINT = MATERIALS["car_paint"].reflectance


def label_instances(
    labels: Labels, calibration: Calibration, world_from_lidar: np.ndarray
) -> tuple[tuple[Instance, ...], int]:
    """One instance a labelled object of a class that has models, and how many objects have none.

    Boxes stand upright in the camera's axes, as KITTI's do: their tilt against the LiDAR is kept. Motion and paint
    are not in labels: instances stand still, and their paint is the material table's until points tell it.

    Args:
        labels: of the frame, without DontCare regions.
        calibration: of the frame.
        world_from_lidar: (4, 4).
    """
    world_from_camera = world_from_lidar @ calibration.rect_to_velo_matrix
    # KITTI's linear calibration is a rotation to six digits; poses are rotations
    left, _, right = np.linalg.svd(world_from_camera[:3, :3])
    turn = left @ right
    instances, without = [], 0
    for row, name in enumerate(labels.type):
        height, width, length = labels.dimensions[row]
        kind = KINDS.get(name.lower())
        if kind is None or min(height, width, length) <= 0:
            without += 1
            continue
        size = np.array([length, width, height])
        spec = models_of_size(kind, size)[0]
        pose = np.eye(4)
        pose[:3, :3] = turn @ _camera_from_box(float(labels.rotation_y[row]))
        pose[:3, 3] = world_from_camera[:3, :3] @ labels.location[row] + world_from_camera[:3, 3]
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
    return tuple(instances), without


def _camera_from_box(rotation_y: float) -> np.ndarray:
    """Axes of an upright box (x forward, y left, z up) in those of the camera (x right, y down, z forward)."""
    forward = np.array([np.cos(rotation_y), 0, -np.sin(rotation_y)])
    up = np.array([0.0, -1.0, 0.0])
    return np.column_stack([forward, np.cross(up, forward), up])
