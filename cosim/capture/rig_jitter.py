"""Random rotation of the sensor rig on its vehicle."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

# Values of each preset that differ from the defaults, which are KITTI's.
_PRESETS: dict[str, dict[str, Any]] = {
    "kitti": {},
    "reference": {"mean_pitch_deg": 0.0, "roll_deg": 1.5, "pitch_deg": 0.5, "yaw_deg": 4.71},
}


class RigJitter(BaseModel):
    """Random rotation of the whole rig about the LiDAR, drawn independently for every frame.

    LiDAR and cameras rotate together, so the calibration between them stays valid.

    The preset `kitti` reproduces the tilt of KITTI's rig relative to the road, estimated from the labels of the
    training set: planes through the bottoms of the cars in a frame are inclined by 0.41 ± 0.39° along and by 0.97°
    across the LiDAR's axes. Suspension and road slopes of the towns already contribute −0.1 ± 0.35° and 0.15°. The
    preset has no yaw: the direction of the road (median heading of at least four nearly aligned cars) varies by 1.7°
    between frames in KITTI, and at least as much in the towns.

    The preset `reference` has the values of the published code of "Synth It Like KITTI"; its yaw approximates that
    code's weighted sum of two normal variables.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = Field(default=False, description="whether the rig is rotated")
    preset: Literal["kitti", "reference"] = Field(
        default="kitti", description="preset that provides the default values"
    )
    mean_pitch_deg: float = Field(
        default=0.5, ge=-10, le=10, description="mean rotation about the left axis, positive nose down [°]"
    )
    roll_deg: float = Field(
        default=0.95, ge=0, le=30, description="standard deviation of the rotation about the forward axis [°]"
    )
    pitch_deg: float = Field(
        default=0.2, ge=0, le=30, description="standard deviation of the rotation about the left axis [°]"
    )
    yaw_deg: float = Field(
        default=0.0, ge=0, le=90, description="standard deviation of the rotation about the upward axis [°]"
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        preset = values.get("preset", "kitti")
        return {**(_PRESETS.get(preset, {}) if isinstance(preset, str) else {}), **values}

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """Draw a rotation (3, 3) in LiDAR axes, Rz(yaw)·Ry(pitch)·Rx(roll); the identity if not enabled."""
        if not self.enabled:
            return np.eye(3)
        roll, pitch, yaw = np.radians(
            rng.normal([0, self.mean_pitch_deg, 0], [self.roll_deg, self.pitch_deg, self.yaw_deg])
        )
        return _rotation("z", yaw) @ _rotation("y", pitch) @ _rotation("x", roll)

    def apply(self, lidar_pose_ego: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Rotate the LiDAR's pose in the ego frame (4, 4) by a random rotation."""
        pose = lidar_pose_ego.copy()
        pose[:3, :3] = pose[:3, :3] @ self.draw(rng)
        return pose


def _rotation(axis: str, angle: float) -> np.ndarray:
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
    return matrix
