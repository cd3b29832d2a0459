"""What effects may know of a frame's images."""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti.calibration import Calibration
from cosim.drives.kitti.frame import Frame
from cosim.drives.kitti.images import DEPTH_SCALE_PER_M, depth_to_png16
from sensors.camera_view import CameraView
from sensors.cameras import Images

CAMERA = 0
"""Number of the camera that effects see by: the left grayscale one."""


def view_of_images(images: Images, P: np.ndarray, pose: np.ndarray) -> CameraView:
    """The view of rendered images, depth as exact as files hold it, so that stored frames give the same."""
    depth = depth_to_png16(images.depth_m).astype(np.float32) / np.float32(DEPTH_SCALE_PER_M)
    return CameraView(images.gray, depth, P, pose)


def view_of_frame(frame: Frame, calibration: Calibration, lidar_pose: np.ndarray) -> CameraView | None:
    """The view of a stored frame; None where its grayscale or depth image is absent.

    Raises:
        CosimError: an image is broken.
    """
    if not frame.has(f"image_{CAMERA}") or not frame.has(f"depth_{CAMERA}") or calibration.P0 is None:
        return None
    gray = frame.image(f"image_{CAMERA}")
    return CameraView(gray, frame.depth, calibration.P0, lidar_pose @ calibration.rect_to_velo_matrix)
