"""Motion of the ego vehicle and of all objects during a revolution.

p(t) = p0 + v·t and R(t) = Rz(ω·t)·R0 in world axes, t from the pose time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sensors.scene import Instances


@dataclass(frozen=True, eq=False)
class EgoMotion:
    """The ego vehicle at the pose time.

    Attributes:
        pose: (4, 4) float64 world pose of the vehicle.
        velocity_mps: (3,) world velocity.
        yaw_rate_radps: positive counter-clockwise.
        acceleration_mps2: (3,) world acceleration.
    """

    pose: np.ndarray
    velocity_mps: np.ndarray
    yaw_rate_radps: float
    acceleration_mps2: np.ndarray

    @classmethod
    def still(cls, pose: np.ndarray) -> EgoMotion:
        """Motion of a stationary vehicle."""
        return cls(np.asarray(pose, float), np.zeros(3), 0.0, np.zeros(3))

    @property
    def forward_acceleration_mps2(self) -> float:
        """Acceleration along the vehicle's own x axis."""
        return float(np.asarray(self.acceleration_mps2) @ self.pose[:3, 0])

    def pose_at(self, time_s: float) -> np.ndarray:
        """World pose, (4, 4), a while after the pose time."""
        velocity, rate = np.asarray(self.velocity_mps, float)[None], np.array([self.yaw_rate_radps])
        return moved_poses(self.pose[None], velocity, rate, time_s)[0]


def moved_poses(poses: np.ndarray, velocity_mps: np.ndarray, yaw_rate_radps: np.ndarray, time_s: float) -> np.ndarray:
    """Poses (k, 4, 4) carried on for `time_s` with velocities (k, 3) and yaw rates (k,)."""
    moved = np.array(poses, float)
    moved[:, :3, :3] = yaw_matrices(np.asarray(yaw_rate_radps) * time_s) @ moved[:, :3, :3]
    moved[:, :3, 3] += np.asarray(velocity_mps) * time_s
    return moved


def instances_at(instances: Instances, time_s: float) -> Instances:
    """The instances a while after the pose time."""
    if time_s == 0 or not len(instances):
        return instances
    poses = moved_poses(instances.poses, instances.velocity_mps, instances.yaw_rate_radps, time_s)
    return replace(instances, poses=poses)


def yaw_matrices(angle_rad: np.ndarray) -> np.ndarray:
    """Rotations about z, (k, 3, 3), by angles (k,)."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    matrix = np.zeros((*np.shape(angle_rad), 3, 3))
    matrix[..., 0, 0] = matrix[..., 1, 1] = cos
    matrix[..., 0, 1], matrix[..., 1, 0] = -sin, sin
    matrix[..., 2, 2] = 1
    return matrix
