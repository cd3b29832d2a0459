"""Grayscale, colour, depth and instance images of pinhole cameras."""

from sensors.cameras.baking import bake_sun_shadows
from sensors.cameras.camera import Camera
from sensors.cameras.errors import CameraError
from sensors.cameras.images import Images
from sensors.cameras.kitti_rig import KITTI_CALIBRATION, KittiCalibration, kitti_cameras, lidar_pose_ego
from sensors.cameras.light import Light
from sensors.cameras.packed_model import PackedModel
from sensors.cameras.renderer import CameraRenderer
from sensors.cameras.semantics import CLASSES, semantic_image

__all__ = [
    "CLASSES",
    "KITTI_CALIBRATION",
    "Camera",
    "CameraError",
    "CameraRenderer",
    "Images",
    "KittiCalibration",
    "Light",
    "PackedModel",
    "bake_sun_shadows",
    "kitti_cameras",
    "lidar_pose_ego",
    "semantic_image",
]
