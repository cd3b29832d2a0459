"""Frames of tilted LiDARs in upright axes.

Boxes rotate about one axis only. In the axes of a LiDAR that is tilted by more than a few degrees no such box fits an
object on the road; in upright axes with the same origin it does.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cached_property

import numpy as np

from cosim.drives.kitti.calibration import Calibration
from cosim.drives.kitti.frame import Frame
from cosim.drives.twin.frame import TwinFrame

_LEANS_DEG = 5.0  # less is a rig's own jitter, which KITTI's boxes bear


def levelled(frame: Frame) -> Frame:
    """Return the frame, in upright axes if its twin says that the LiDAR is tilted by more than 5°."""
    if not frame.has("twin/frames"):
        return frame
    upwards = float(frame.twin.lidar.pose_ego[2, 2])
    if upwards > np.cos(np.radians(_LEANS_DEG)):
        return frame
    return LevelFrame(**{field.name: getattr(frame, field.name) for field in fields(Frame)})


class LevelFrame(Frame):
    """A frame with points, calibration and LiDAR pose in upright axes with the LiDAR's origin."""

    @cached_property
    def points(self) -> np.ndarray:
        """(n, 4) float32 x, y, z [m] in upright axes and intensity."""
        points = self._leaning.points.copy()
        points[:, :3] = points[:, :3] @ self._turn[:3, :3].T
        return points

    @cached_property
    def calibration(self) -> Calibration:
        """Calibration of an upright LiDAR at the same position."""
        own, back = self._leaning.calibration, self._turn.T
        return replace(
            own,
            Tr_velo_to_cam=own.Tr_velo_to_cam @ back,
            Tr_imu_to_velo=None if own.Tr_imu_to_velo is None else self._turn[:3, :3] @ own.Tr_imu_to_velo,
            named={name: (P, to_rect @ back) for name, (P, to_rect) in own.named.items()},
        )

    @cached_property
    def twin(self) -> TwinFrame:
        """Poses and motion; the LiDAR's pose is upright."""
        own = self._leaning.twin
        return replace(own, lidar=replace(own.lidar, pose_ego=own.lidar.pose_ego @ self._turn.T))

    @cached_property
    def _leaning(self) -> Frame:
        """The frame in the axes of the LiDAR."""
        return Frame(**{field.name: getattr(self, field.name) for field in fields(Frame)})

    @cached_property
    def _turn(self) -> np.ndarray:
        """Upright axes from the LiDAR's, (4, 4) a rotation."""
        pose = self._leaning.twin.lidar.pose_ego
        yaw = np.arctan2(pose[1, 0], pose[0, 0])
        upright = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        turn = np.eye(4)
        turn[:3, :3] = upright.T @ pose[:3, :3]
        return turn
