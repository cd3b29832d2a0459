"""Where LiDAR and cameras sit on their vehicle, and what follows for the calibration."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator
from scipy.spatial.transform import Rotation

from cosim.drives.kitti.calibration import Calibration
from sensors.cameras.kitti_rig import KITTI_CALIBRATION, LIDAR_IN_EGO_M, camera_pose_ego, lidar_pose_ego

# Within this box about the ego origin there is bodywork of any car, whatever its size [m].
_BODY_LOW, _BODY_HIGH = (-1.6, -0.75, 0.3), (1.6, 0.75, 1.35)
_CAMERA_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # x right, y down, z forward


class Mount(BaseModel):
    """A place on the vehicle and the way a sensor looks from there.

    The origin is the ground-level centre of the vehicle's box; x forward, y left, z up. The rotation is
    Rz(yaw)·Ry(pitch)·Rx(roll), right-handed: pitch above 0 looks down, yaw above 0 to the left.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    x_m: float = Field(ge=-30, le=30, description="forward of the middle of the vehicle [m]")
    y_m: float = Field(default=0.0, ge=-30, le=30, description="left of the middle of the vehicle [m]")
    z_m: float = Field(ge=0, le=30, description="above the ground [m]")
    roll_deg: float = Field(default=0.0, ge=-180, le=180, description="about the forward axis, to the right [°]")
    pitch_deg: float = Field(default=0.0, ge=-90, le=90, description="about the left axis, looking down [°]")
    yaw_deg: float = Field(default=0.0, ge=-180, le=180, description="about the upward axis, to the left [°]")

    @model_validator(mode="after")
    def _outside(self) -> Mount:
        place = (self.x_m, self.y_m, self.z_m)
        if all(low < at < high for low, at, high in zip(_BODY_LOW, place, _BODY_HIGH, strict=True)):
            raise ValueError(
                f"({self.x_m:g}, {self.y_m:g}, {self.z_m:g}) m lies inside the vehicle; "
                f"mount it above {_BODY_HIGH[2]:g} m, or beyond {_BODY_HIGH[0]:g} m of the middle"
            )
        return self

    @property
    def pose(self) -> np.ndarray:
        """Ego axes from the sensor's own, x forward, y left, z up, (4, 4)."""
        matrix = np.eye(4)
        turns = (self.yaw_deg, self.pitch_deg, self.roll_deg)
        matrix[:3, :3] = Rotation.from_euler("ZYX", turns, degrees=True).as_matrix()
        matrix[:3, 3] = self.x_m, self.y_m, self.z_m
        return matrix


class Mounts(BaseModel):
    """Where the LiDAR and the row of cameras are mounted; by default as on KITTI's car.

    Cameras keep KITTI's lenses and their distances from each other; the mount is that of camera 0.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    lidar: Mount = Field(
        default=Mount(x_m=LIDAR_IN_EGO_M[0], y_m=LIDAR_IN_EGO_M[1], z_m=LIDAR_IN_EGO_M[2]),
        description="of the LiDAR",
    )
    cameras: Mount | None = Field(default=None, description="of camera 0; none: where KITTI's is")

    @property
    def lidar_pose(self) -> np.ndarray:
        """Ego axes from the LiDAR's, (4, 4)."""
        return self.lidar.pose

    @property
    def calibration(self) -> Calibration:
        """What `calib/` says of sensors so mounted; KITTI's to the last digit where nothing is moved."""
        if self == Mounts():
            return Calibration(**vars(KITTI_CALIBRATION))
        camera = camera_pose_ego(KITTI_CALIBRATION)
        if self.cameras is not None:
            camera = self.cameras.pose.copy()
            camera[:3, :3] = camera[:3, :3] @ _CAMERA_AXES
        imu = np.eye(4)
        imu[:3] = KITTI_CALIBRATION.Tr_imu_to_velo
        moved = {
            "Tr_velo_to_cam": (np.linalg.inv(camera) @ self.lidar_pose)[:3],
            "Tr_imu_to_velo": (np.linalg.inv(self.lidar_pose) @ lidar_pose_ego() @ imu)[:3],
        }
        return Calibration(**{**vars(KITTI_CALIBRATION), **moved})
