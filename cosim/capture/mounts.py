"""Mounts of LiDAR and cameras on the vehicle, and the calibration that results from them."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from cosim.drives.kitti.calibration import Calibration
from sensors.cameras.kitti_rig import KITTI_CALIBRATION, LIDAR_IN_EGO_M, camera_pose_ego, lidar_pose_ego
from sensors.mount import Mount


class Mounts(BaseModel):
    """Mounts of the LiDAR and of the row of cameras; by default those of KITTI's car.

    The cameras keep KITTI's intrinsic parameters and baselines; `cameras` is the mount of camera 0.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    lidar: Mount = Field(
        default=Mount(x_m=LIDAR_IN_EGO_M[0], y_m=LIDAR_IN_EGO_M[1], z_m=LIDAR_IN_EGO_M[2]),
        description="mount of the LiDAR",
    )
    cameras: Mount | None = Field(default=None, description="mount of camera 0; none: KITTI's")

    @property
    def lidar_pose(self) -> np.ndarray:
        """Pose of the LiDAR in the ego frame, (4, 4)."""
        return self.lidar.pose

    @property
    def calibration(self) -> Calibration:
        """Calibration in `calib/` for these mounts; exactly KITTI's if all mounts have their default values."""
        if self == Mounts():
            return Calibration(**vars(KITTI_CALIBRATION))
        camera = camera_pose_ego(KITTI_CALIBRATION)
        if self.cameras is not None:
            camera = self.cameras.camera_pose
        imu = np.eye(4)
        imu[:3] = KITTI_CALIBRATION.Tr_imu_to_velo
        moved = {
            "Tr_velo_to_cam": (np.linalg.inv(camera) @ self.lidar_pose)[:3],
            "Tr_imu_to_velo": (np.linalg.inv(self.lidar_pose) @ lidar_pose_ego() @ imu)[:3],
        }
        return Calibration(**{**vars(KITTI_CALIBRATION), **moved})
