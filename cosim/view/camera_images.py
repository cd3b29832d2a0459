"""Images of a frame, and the projection of LiDAR axes into them."""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti import Frame
from sensors.cameras.lens import undistorted

KITTI_CAMERAS = ("image_2", "image_0", "image_3", "image_1")
"""Image folders of KITTI's rig in order of preference."""


def camera_parts(frame: Frame) -> tuple[str, ...]:
    """Folders of the images that a frame has and its calibration contains, the labels' camera first."""
    known = frame.calibration
    if frame.reference:
        names = (frame.reference, *(name for name in known.named if name != frame.reference))
        return tuple(part for part in (f"image_{name}" for name in names) if frame.has(part))
    return tuple(part for part in KITTI_CAMERAS if known.knows(part[6:]) and frame.has(part))


def straight_image(frame: Frame, part: str) -> np.ndarray:
    """An image without its lens's distortion, into which projections are straight: (h, w) or (h, w, 3) uint8."""
    image = frame.image(part)
    if not frame.reference or not frame.has("twin/frames"):
        return image
    own = f"image_{frame.reference}" if part == "image_2" else part
    camera = frame.twin.cameras.get(own)
    if camera is None or camera.distortion is None:
        return image
    return undistorted(image, camera.P[:, :3], camera.distortion)
