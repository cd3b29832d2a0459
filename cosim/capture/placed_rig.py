"""Rig geometry for the recorder: poses of all sensors relative to the first LiDAR, and their calibrations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cosim.capture.mounts import Mounts
from cosim.drives.kitti.calibration import Calibration
from sensors.cameras.imaging import Imaging
from sensors.cameras.kitti_rig import nearest_rotation
from sensors.cameras.lens import Lens
from sensors.mount import CAMERA_AXES
from sensors.rig import KITTI_ROW, Rig, RigCamera

if TYPE_CHECKING:
    from cosim.capture.config import RunConfig

_UPWARDS = 1.0 - 1e-12


@dataclass(frozen=True, eq=False)
class PlacedCamera:
    """A camera of a rig.

    Attributes:
        name: name as in `image_NAME`.
        kind: `colour` or `gray`.
        width, height: image size [px].
        P: (3, 4) projection from camera axes to pixels.
        in_lidar: (4, 4) pose in the first LiDAR's axes; camera axes are x right, y down, z forward.
        lens: lens distortion; None for a pinhole camera.
        imaging: exposure and noise of the image sensor.
        calibration: calibration for labels of this camera, from the first LiDAR's level axes to the camera's level
            axes, with the camera's projection as P2; None if the camera has no labels.
    """

    name: str
    kind: str
    width: int
    height: int
    P: np.ndarray
    in_lidar: np.ndarray
    lens: Lens | None
    imaging: Imaging
    calibration: Calibration | None


@dataclass(frozen=True, eq=False)
class PlacedRig:
    """A rig on its carrier.

    Attributes:
        lidar_pose: (4, 4) pose of the first LiDAR in the carrier's axes.
        level: (4, 4) rotation from the first LiDAR's level axes (z up) to its own axes; label boxes are upright in the
            level axes.
        lidars: (4, 4) pose of every LiDAR in the first LiDAR's axes, by name, the first LiDAR first.
        cameras: cameras by name.
        reference: name of the camera that `calib/` and `label_2/` refer to.
        calibrations: calibrations in `calib/`, by LiDAR.
    """

    lidar_pose: np.ndarray
    level: np.ndarray
    lidars: Mapping[str, np.ndarray]
    cameras: Mapping[str, PlacedCamera]
    reference: str
    calibrations: Mapping[str, Calibration]

    @property
    def first(self) -> str:
        """Name of the first LiDAR."""
        return next(iter(self.lidars))


def place_rig(config: RunConfig) -> PlacedRig:
    """Compute the geometry of a run's rig; exactly KITTI's with the default configuration."""
    rig, mounts = config.rig_used, config.mounts
    lidar_pose = rig.lidars[0].mount.pose if mounts == Mounts() else mounts.lidar_pose
    from_carrier = np.linalg.inv(lidar_pose)
    lidars = {lidar.name: from_carrier @ lidar.mount.pose for lidar in rig.lidars}
    lidars[rig.lidars[0].name] = np.eye(4)
    reference = rig.reference
    if rig.kitti_row:
        kitti = _kitti_calibration(rig, lidar_pose) if mounts == Mounts() else mounts.calibration
        calibration = kitti
        poses = dict.fromkeys((camera.name for camera in rig.cameras), kitti.rect_to_velo_matrix)
    else:
        poses = {camera.name: _pose_in_lidar(camera, from_carrier) for camera in rig.cameras}
        calibration = _calibration(rig, lidar_pose, poses)
    cameras = {
        camera.name: PlacedCamera(
            name=camera.name,
            kind=camera.kind,
            width=camera.width_px,
            height=camera.height_px,
            P=camera.projection,
            in_lidar=poses[camera.name],
            lens=_lens(camera),
            imaging=camera.imaging,
            calibration=_label_calibration(camera, reference, calibration, lidar_pose, poses[camera.name]),
        )
        for camera in rig.cameras
    }
    calibrations = {name: _calibration_of_lidar(calibration, pose) for name, pose in lidars.items()}
    return PlacedRig(lidar_pose, _level(lidar_pose), lidars, cameras, reference.name, calibrations)


def _kitti_calibration(rig: Rig, lidar_pose: np.ndarray) -> Calibration:
    """Calibration of a row of rectified cameras with common axes, with the given matrices."""
    reference = rig.reference
    projections = {f"P{camera.name}": camera.projection for camera in rig.cameras}
    if reference.from_lidar is not None:
        to_camera = nearest_rotation(reference.from_lidar)
    else:
        assert reference.mount is not None  # a camera has from_lidar or mount
        to_camera = (np.linalg.inv(reference.mount.camera_pose) @ lidar_pose)[:3]
    return Calibration(
        P0=projections.get("P0"),
        P1=projections.get("P1"),
        P2=projections.get("P2", reference.projection),
        P3=projections.get("P3"),
        R0_rect=np.eye(3),
        Tr_velo_to_cam=to_camera,
        Tr_imu_to_velo=_imu(rig, lidar_pose),
    )


def _calibration(rig: Rig, lidar_pose: np.ndarray, poses: Mapping[str, np.ndarray]) -> Calibration:
    """Calibration of independent cameras.

    P0 to P3 are the projection of the reference camera, R0_rect rotates to its level axes, and the matrices of every
    camera are stored under its name.
    """
    reference = rig.reference
    rotation = _level_rotation(lidar_pose @ poses[reference.name])
    P = _project_from_level(reference.projection, rotation)
    return Calibration(
        P0=P,
        P1=P,
        P2=P,
        P3=P,
        R0_rect=rotation,
        Tr_velo_to_cam=np.linalg.inv(poses[reference.name])[:3],
        Tr_imu_to_velo=_imu(rig, lidar_pose),
        named={
            camera.name: (
                _project_from_level(camera.projection, level := _level_rotation(lidar_pose @ poses[camera.name])),
                _homogeneous(level) @ np.linalg.inv(poses[camera.name]),
            )
            for camera in rig.cameras
        },
    )


def _label_calibration(
    camera: RigCamera, reference: RigCamera, calibration: Calibration, lidar_pose: np.ndarray, pose: np.ndarray
) -> Calibration | None:
    """Calibration from the LiDAR's level axes to a camera's level axes; None if the camera has no labels."""
    if camera is not reference and (not camera.labels or camera.name in KITTI_ROW):
        return None
    level = _level(lidar_pose)
    if camera is reference:
        if np.array_equal(level, np.eye(4)):
            return calibration
        to_rect, P = calibration.velo_to_rect_matrix, calibration.P2
    else:
        rotation = _level_rotation(lidar_pose @ pose)
        to_rect, P = _homogeneous(rotation) @ np.linalg.inv(pose), _project_from_level(camera.projection, rotation)
    return Calibration(P2=P, R0_rect=np.eye(3), Tr_velo_to_cam=(to_rect @ level)[:3])


def _imu(rig: Rig, lidar_pose: np.ndarray) -> np.ndarray:
    return np.linalg.inv(lidar_pose)[:3] if rig.imu_to_lidar is None else nearest_rotation(rig.imu_to_lidar)


def _calibration_of_lidar(calibration: Calibration, pose: np.ndarray) -> Calibration:
    """Calibration of a LiDAR with pose (4, 4) in the first LiDAR's axes."""
    if np.array_equal(pose, np.eye(4)):
        return calibration
    values = {**vars(calibration)}
    values = {name: values[name] for name in ("P0", "P1", "P2", "P3", "R0_rect")}
    imu = calibration.Tr_imu_to_velo
    assert imu is not None  # set by both functions above
    return Calibration(
        **values,
        Tr_velo_to_cam=calibration.Tr_velo_to_cam @ pose,
        Tr_imu_to_velo=(np.linalg.inv(pose) @ np.vstack([imu, [0, 0, 0, 1]]))[:3],
        named={name: (P, to_rect @ pose) for name, (P, to_rect) in calibration.named.items()},
    )


def _pose_in_lidar(camera: RigCamera, from_carrier: np.ndarray) -> np.ndarray:
    if camera.from_lidar is not None:
        return np.linalg.inv(np.vstack([nearest_rotation(camera.from_lidar), [0, 0, 0, 1]]))
    assert camera.mount is not None  # a camera has from_lidar or mount
    return from_carrier @ camera.mount.camera_pose


def _lens(camera: RigCamera) -> Lens | None:
    if camera.distortion is None:
        return None
    return Lens.of(camera.projection[:, :3], camera.width_px, camera.height_px, camera.distortion)


def _level(pose: np.ndarray) -> np.ndarray:
    """Rotation (4, 4) from a sensor's level axes to its own axes; the identity if the sensor is level."""
    if pose[2, 2] > _UPWARDS:
        return np.eye(4)
    yaw = np.arctan2(pose[1, 0], pose[0, 0])
    return _homogeneous(pose[:3, :3].T @ _yaw_rotation(yaw))


def _level_rotation(camera_pose: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) from a camera's axes to its level axes (y straight down), from its pose (4, 4) on the carrier."""
    rotation = camera_pose[:3, :3]
    if rotation[2, 1] < -_UPWARDS:
        return np.eye(3)
    yaw = np.arctan2(rotation[1, 2], rotation[0, 2])
    return (_yaw_rotation(yaw) @ CAMERA_AXES).T @ rotation


def _project_from_level(P: np.ndarray, to_level: np.ndarray) -> np.ndarray:
    return np.column_stack([P[:, :3] @ to_level.T, P[:, 3]])


def _homogeneous(rotation: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    return matrix


def _yaw_rotation(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
