"""Camera views that effects can use, from rendered or stored images."""

from __future__ import annotations

from collections.abc import Collection

import cv2
import numpy as np

from cosim.drives.kitti.calibration import Calibration
from cosim.drives.kitti.frame import Frame
from cosim.drives.kitti.images import DEPTH_SCALE_PER_M, depth_to_png16, read_depth
from sensors.camera_view import CameraView
from sensors.cameras import Images

_GRAY = "0"


def effect_camera(names: Collection[str], reference: str) -> str:
    """Name of the camera whose images effects use: KITTI's left grayscale camera, else the labels' camera."""
    return _GRAY if _GRAY in names else reference


def view_of_images(images: Images, P: np.ndarray, pose: np.ndarray) -> CameraView:
    """View of rendered images, with depth rounded as in files so that stored frames give the same result."""
    depth = depth_to_png16(images.depth_m).astype(np.float32) / np.float32(DEPTH_SCALE_PER_M)
    return CameraView(images.gray, depth, P, pose)


def view_of_frame(frame: Frame, calibration: Calibration, lidar_pose: np.ndarray) -> CameraView | None:
    """View of a stored frame; None if its grayscale or depth image does not exist.

    Raises:
        CosimError: an image is damaged.
    """
    camera = frame.reference or _GRAY
    if not frame.has(f"image_{camera}") or not frame.has(f"depth_{camera}") or calibration.P0 is None:
        return None
    gray, depth = frame.image(f"image_{camera}"), read_depth(frame.path(f"depth_{camera}"))
    if gray.ndim == 3:
        gray = cv2.cvtColor(gray, cv2.COLOR_RGB2GRAY)
    seen = frame.twin.cameras.get(f"image_{camera}") if frame.reference else None
    if seen is None:
        return CameraView(gray, depth, calibration.P0, lidar_pose @ calibration.rect_to_velo_matrix)
    if seen.distortion is not None:
        return None  # the projection matrix does not describe a distorted image
    return CameraView(gray, depth, seen.P, frame.twin.ego.pose @ seen.pose_ego)
