"""Grayscale, colour, depth and instance images of pinhole cameras."""

from sensors.cameras.baking import SunShadows
from sensors.cameras.camera import Camera
from sensors.cameras.errors import CameraError
from sensors.cameras.images import Content, Images
from sensors.cameras.kitti_rig import KITTI_CALIBRATION, KittiCalibration, kitti_cameras, lidar_pose_ego
from sensors.cameras.light import Light
from sensors.cameras.packed_model import PackedModel
from sensors.cameras.renderer import CameraRenderer
from sensors.cameras.semantics import CLASSES, semantic_image
from sensors.cameras.tiles import Tiles

__all__ = [
    "CLASSES",
    "KITTI_CALIBRATION",
    "Camera",
    "CameraError",
    "CameraRenderer",
    "Content",
    "Images",
    "KittiCalibration",
    "Light",
    "PackedModel",
    "SunShadows",
    "Tiles",
    "kitti_cameras",
    "lidar_pose_ego",
    "semantic_image",
]
