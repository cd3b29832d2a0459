"""How the sensor rig sits on its vehicle, frame by frame."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

# What a preset says where it differs from the defaults, which are KITTI's.
_PRESETS: dict[str, dict[str, Any]] = {
    "kitti": {},
    "reference": {"mean_pitch_deg": 0.0, "roll_deg": 1.5, "pitch_deg": 0.5, "yaw_deg": 4.71},
}


class RigJitter(BaseModel):
    """Random rotation of the whole rig about the LiDAR, drawn anew for every frame.

    LiDAR and cameras turn together, so the calibration between them stays true. The preset `kitti` is how the
    measured rig stood on its road, from the labels of KITTI's training set: planes through the bottoms of the cars of
    a frame are inclined by 0.41 ± 0.39° along and by 0.97° across the LiDAR's axes, of which bodies on their springs
    and the towns' slopes already give −0.1 ± 0.35° and 0.15°. It has
    no yaw: the direction of the road, as the median heading of four cars or more nearly in line, varies by 1.7° from
    frame to frame in KITTI and no less in the towns, whose streets bend. The preset `reference` holds the values of
    the published code of "Synth It Like KITTI"; its yaw is the sum of two weighted normals.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = Field(default=False, description="whether the rig turns at all")
    preset: Literal["kitti", "reference"] = Field(default="kitti", description="where values come from by default")
    mean_pitch_deg: float = Field(default=0.5, ge=-10, le=10, description="mean about the left axis, nose down [°]")
    roll_deg: float = Field(default=0.95, ge=0, le=30, description="standard deviation about the forward axis [°]")
    pitch_deg: float = Field(default=0.2, ge=0, le=30, description="standard deviation about the left axis [°]")
    yaw_deg: float = Field(default=0.0, ge=0, le=90, description="standard deviation about the upward axis [°]")

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        preset = values.get("preset", "kitti")
        return {**(_PRESETS.get(preset, {}) if isinstance(preset, str) else {}), **values}

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """A rotation (3, 3) in LiDAR axes, Rz(yaw)·Ry(pitch)·Rx(roll); the identity where switched off."""
        if not self.enabled:
            return np.eye(3)
        roll, pitch, yaw = np.radians(
            rng.normal([0, self.mean_pitch_deg, 0], [self.roll_deg, self.pitch_deg, self.yaw_deg])
        )
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
