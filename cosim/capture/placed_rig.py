"""A rig as a recorder needs it: every sensor's pose from the first LiDAR's, and what `calib/` says of each."""

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
        name: as in `image_NAME`.
        kind: `colour` or `gray`.
        width, height: of its images [px].
        P: (3, 4) from its axes to pixels.
        in_lidar: (4, 4) the first LiDAR's axes from its own, x right, y down, z forward.
        lens: bends its image; None for a pinhole.
        imaging: what it makes of the light.
        calibration: the first LiDAR's axes to this camera's level ones, its projection as P2: labels drawn in it refer
            to these. None where none are drawn.
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
        lidar_pose: (4, 4) the carrier's axes from the first LiDAR's.
        level: (4, 4) the first LiDAR's axes from the same that stand upright: labels' boxes are upright in those.
        lidars: (4, 4) the first LiDAR's axes from those of each, by name, the first one first.
        cameras: by name.
        reference: name of the camera that `calib/` and `label_2/` refer to.
        calibrations: what `calib/` says, by LiDAR.
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
    """The rig of a run; KITTI's to the last digit where nothing is said."""
    rig, mounts = config.rig_used, config.mounts
    lidar_pose = rig.lidars[0].mount.pose if mounts == Mounts() else mounts.lidar_pose
    from_carrier = np.linalg.inv(lidar_pose)
    lidars = {one.name: from_carrier @ one.mount.pose for one in rig.lidars}
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
            calibration=_labelled(camera, reference, calibration, lidar_pose, poses[camera.name]),
        )
        for camera in rig.cameras
    }
    calibrations = {name: _seen_from(calibration, pose) for name, pose in lidars.items()}
    return PlacedRig(lidar_pose, _level(lidar_pose), lidars, cameras, reference.name, calibrations)


def _kitti_calibration(rig: Rig, lidar_pose: np.ndarray) -> Calibration:
    """Of a row of rectified cameras with common axes: its matrices as they are given."""
    reference = rig.reference
    projections = {f"P{camera.name}": camera.projection for camera in rig.cameras}
    if reference.from_lidar is not None:
        to_camera = nearest_rotation(reference.from_lidar)
    else:
        assert reference.mount is not None  # one of both, as was checked
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
    """Of free cameras: the reference's as P0 to P3, R0_rect to its level axes, and every camera's under its name."""
    reference = rig.reference
    turned = _levelling(lidar_pose @ poses[reference.name])
    P = _from_level(reference.projection, turned)
    return Calibration(
        P0=P,
        P1=P,
        P2=P,
        P3=P,
        R0_rect=turned,
        Tr_velo_to_cam=np.linalg.inv(poses[reference.name])[:3],
        Tr_imu_to_velo=_imu(rig, lidar_pose),
        named={
            camera.name: (
                _from_level(camera.projection, level := _levelling(lidar_pose @ poses[camera.name])),
                _turned(level) @ np.linalg.inv(poses[camera.name]),
            )
            for camera in rig.cameras
        },
    )


def _labelled(
    camera: RigCamera, reference: RigCamera, calibration: Calibration, lidar_pose: np.ndarray, pose: np.ndarray
) -> Calibration | None:
    """Level LiDAR axes to the level axes of a camera that labels are drawn in."""
    if camera is not reference and (not camera.labels or camera.name in KITTI_ROW):
        return None
    level = _level(lidar_pose)
    if camera is reference:
        if np.array_equal(level, np.eye(4)):
            return calibration
        to_rect, P = calibration.velo_to_rect_matrix, calibration.P2
    else:
        turned = _levelling(lidar_pose @ pose)
        to_rect, P = _turned(turned) @ np.linalg.inv(pose), _from_level(camera.projection, turned)
    return Calibration(P2=P, R0_rect=np.eye(3), Tr_velo_to_cam=(to_rect @ level)[:3])


def _imu(rig: Rig, lidar_pose: np.ndarray) -> np.ndarray:
    return np.linalg.inv(lidar_pose)[:3] if rig.imu_to_lidar is None else nearest_rotation(rig.imu_to_lidar)


def _seen_from(calibration: Calibration, pose: np.ndarray) -> Calibration:
    """The calibration of a LiDAR with a pose (4, 4) in the first one's axes."""
    if np.array_equal(pose, np.eye(4)):
        return calibration
    values = {**vars(calibration)}
    values = {name: values[name] for name in ("P0", "P1", "P2", "P3", "R0_rect")}
    imu = calibration.Tr_imu_to_velo
    assert imu is not None  # rigs have one
    return Calibration(
        **values,
        Tr_velo_to_cam=calibration.Tr_velo_to_cam @ pose,
        Tr_imu_to_velo=(np.linalg.inv(pose) @ np.vstack([imu, [0, 0, 0, 1]]))[:3],
        named={name: (P, to_rect @ pose) for name, (P, to_rect) in calibration.named.items()},
    )


def _pose_in_lidar(camera: RigCamera, from_carrier: np.ndarray) -> np.ndarray:
    if camera.from_lidar is not None:
        return np.linalg.inv(np.vstack([nearest_rotation(camera.from_lidar), [0, 0, 0, 1]]))
    assert camera.mount is not None  # one of both, as was checked
    return from_carrier @ camera.mount.camera_pose


def _lens(camera: RigCamera) -> Lens | None:
    if camera.distortion is None:
        return None
    return Lens.of(camera.projection[:, :3], camera.width_px, camera.height_px, camera.distortion)


def _level(pose: np.ndarray) -> np.ndarray:
    """A sensor's axes from the same turned upright, (4, 4): the identity where they are."""
    if pose[2, 2] > _UPWARDS:
        return np.eye(4)
    yaw = np.arctan2(pose[1, 0], pose[0, 0])
    return _turned(pose[:3, :3].T @ _about_up(yaw))


def _levelling(camera_pose: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) from a camera's axes to the same with y straight down; (4, 4) is its pose on the carrier."""
    rotation = camera_pose[:3, :3]
    if rotation[2, 1] < -_UPWARDS:
        return np.eye(3)
    yaw = np.arctan2(rotation[1, 2], rotation[0, 2])
    return (_about_up(yaw) @ CAMERA_AXES).T @ rotation


def _from_level(P: np.ndarray, levelling: np.ndarray) -> np.ndarray:
    return np.column_stack([P[:, :3] @ levelling.T, P[:, 3]])


def _turned(rotation: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    return matrix


def _about_up(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
