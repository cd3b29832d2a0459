"""How the sensor rig sits on its vehicle, frame by frame."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field


class RigJitter(BaseModel):
    """Random rotation of the whole rig about the LiDAR, drawn anew for every frame.

    LiDAR and cameras turn together, so the calibration between them stays true. The values are those of the
    published code of "Synth It Like KITTI"; yaw is the sum of its two weighted normals.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = Field(default=False, description="whether the rig turns at all")
    roll_deg: float = Field(default=1.5, ge=0, le=30, description="standard deviation about the forward axis [°]")
    pitch_deg: float = Field(default=0.5, ge=0, le=30, description="standard deviation about the left axis [°]")
    yaw_deg: float = Field(default=4.71, ge=0, le=90, description="standard deviation about the upward axis [°]")

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """A rotation (3, 3) in LiDAR axes, Rz(yaw)·Ry(pitch)·Rx(roll); the identity where switched off."""
        if not self.enabled:
            return np.eye(3)
        roll, pitch, yaw = np.radians(rng.normal(0, [self.roll_deg, self.pitch_deg, self.yaw_deg]))
        return _about("z", yaw) @ _about("y", pitch) @ _about("x", roll)

    def turned(self, lidar_pose_ego: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """The LiDAR's pose in the ego frame (4, 4) with one draw of the rotation."""
        pose = lidar_pose_ego.copy()
        pose[:3, :3] = pose[:3, :3] @ self.draw(rng)
        return pose


def _about(axis: str, angle: float) -> np.ndarray:
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
    return matrix
