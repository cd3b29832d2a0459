"""KITTI's camera and LiDAR rig: the calibration of 2011-09-26, as the object benchmark's files state it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sensors.cameras.camera import Camera

WIDTH_PX = 1242
HEIGHT_PX = 375
LIDAR_IN_EGO_M = (-0.5, 0.0, 1.73)

_FOCAL_PX, _CENTRE_PX = 721.5377, (609.5593, 172.854)
_STEREO_PX_M = (0.0, -387.5744, 44.85728, -339.5242)  # −focal × distance to the right of camera 0
_VELO_TO_CAM = (
    (7.533745e-03, -9.999714e-01, -6.166020e-04, -4.069766e-03),
    (1.480249e-02, 7.280733e-04, -9.998902e-01, -7.631618e-02),
    (9.998621e-01, 7.523790e-03, 1.480755e-02, -2.717806e-01),
)
_IMU_TO_VELO = (
    (9.999976e-01, 7.553071e-04, -2.035826e-03, -8.086759e-01),
    (-7.854027e-04, 9.998898e-01, -1.482298e-02, 3.195559e-01),
    (2.024406e-03, 1.482454e-02, 9.998881e-01, -7.997231e-01),
)


@dataclass(frozen=True, eq=False)
class KittiCalibration:
    """Contents of a KITTI `calib` file; a LiDAR point x projects as P · R0_rect · Tr_velo_to_cam · x.

    Attributes:
        P0, P1, P2, P3: (3, 4) float64 projections of the rectified cameras, camera-0 axes to pixels.
        R0_rect: (3, 3) rectifying rotation; the simulated cameras are rectified by construction: identity.
        Tr_velo_to_cam: (3, 4) camera 0 from LiDAR, a rotation to machine precision.
        Tr_imu_to_velo: (3, 4) LiDAR from inertial unit.
    """

    P0: np.ndarray
    P1: np.ndarray
    P2: np.ndarray
    P3: np.ndarray
    R0_rect: np.ndarray
    Tr_velo_to_cam: np.ndarray
    Tr_imu_to_velo: np.ndarray


def lidar_pose_ego() -> np.ndarray:
    """Ego-from-LiDAR (4, 4): ego origin at the ground-level centre of its box, x forward, y left, z up."""
    pose = np.eye(4)
    pose[:3, 3] = LIDAR_IN_EGO_M
    return pose


def camera_pose_ego(calibration: KittiCalibration) -> np.ndarray:
    """Ego-from-camera-0 (4, 4), rectified axes: one pose for every camera, whose P holds its stereo offset."""
    camera_from_lidar = np.eye(4)
    camera_from_lidar[:3] = calibration.R0_rect @ calibration.Tr_velo_to_cam
    return lidar_pose_ego() @ np.linalg.inv(camera_from_lidar)


def kitti_cameras(calibration: KittiCalibration) -> dict[str, Camera]:
    """The four cameras by KITTI name, `image_0` … `image_3`."""
    pose = camera_pose_ego(calibration)
    projections = (calibration.P0, calibration.P1, calibration.P2, calibration.P3)
    names = (f"image_{index}" for index in range(4))
    return {name: Camera(name, P, pose, WIDTH_PX, HEIGHT_PX) for name, P in zip(names, projections, strict=True)}


def _projection(stereo_px_m: float) -> np.ndarray:
    (u, v), f = _CENTRE_PX, _FOCAL_PX
    return _frozen(np.array([[f, 0.0, u, stereo_px_m], [0.0, f, v, 0.0], [0.0, 0.0, 1.0, 0.0]]))


def nearest_rotation(rows: tuple[tuple[float, ...], ...]) -> np.ndarray:
    """[R | t] (3, 4), the nearest rotation to printed digits (polar decomposition), and their translation."""
    matrix = np.array(rows)
    left, _, right = np.linalg.svd(matrix[:, :3])
    matrix[:, :3] = left @ right
    return _frozen(matrix)


def _frozen(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


KITTI_CALIBRATION = KittiCalibration(
    *(_projection(offset) for offset in _STEREO_PX_M),
    R0_rect=_frozen(np.eye(3)),
    Tr_velo_to_cam=nearest_rotation(_VELO_TO_CAM),
    Tr_imu_to_velo=nearest_rotation(_IMU_TO_VELO),
)
