"""A pinhole camera in KITTI's terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sensors.cameras.errors import CameraError


@dataclass(frozen=True, eq=False)
class Camera:
    """A rectified camera: pose and projection.

    Attributes:
        name: KITTI name, such as `image_2`.
        P: (3, 4) float64 projection from rectified camera-0 axes to pixels, K [I | t]; the fourth column
            holds the stereo offset. Integer pixel (u, v) is the centre of column u, row v.
        pose: (4, 4) float64 ego-from-camera-0, camera axes x right, y down, z forward [m].
        width, height: image size [px].
    """

    name: str
    P: np.ndarray
    pose: np.ndarray
    width: int
    height: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "P", np.array(self.P, np.float64))
        object.__setattr__(self, "pose", np.array(self.pose, np.float64))
        if self.P.shape != (3, 4) or self.pose.shape != (4, 4):
            raise CameraError(
                f"camera {self.name}: P is {self.P.shape} and pose {self.pose.shape}: give 3 × 4 and 4 × 4"
            )
        if self.width < 1 or self.height < 1:
            raise CameraError(f"camera {self.name}: {self.width} × {self.height} pixels: give at least 1 × 1")

    def project(self, points_cam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels and depths of points.

        Args:
            points_cam: (n, 3) in rectified camera-0 axes [m].

        Returns:
            uv (n, 2) float64 [px], meaningful where depth > 0, and depth (n,) float64 [m] along the
            optical axis.
        """
        points = np.asarray(points_cam, np.float64).reshape(-1, 3)
        homogeneous = points @ self.P[:, :3].T + self.P[:, 3]
        depth = homogeneous[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            return homogeneous[:, :2] / depth[:, None], depth
