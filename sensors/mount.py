"""Position and orientation of a sensor on its vehicle."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

# Within this box about the ego origin there is bodywork of any car, whatever its size [m].
_BODY_LOW, _BODY_HIGH = (-1.6, -0.75, 0.3), (1.6, 0.75, 1.35)

CAMERA_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""A camera's axes, x right, y down, z forward, as columns in axes x forward, y left, z up."""


class Place(BaseModel):
    """Position and orientation of a sensor on its carrier.

    The origin is the ground-level centre of the vehicle's box, or the foot of the mast; x forward, y left, z up. The
    rotation is Rz(yaw)·Ry(pitch)·Rx(roll), right-handed: pitch above 0 looks down, yaw above 0 to the left.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    x_m: float = Field(ge=-30, le=30, description="forward of the middle of the vehicle [m]")
    y_m: float = Field(default=0.0, ge=-30, le=30, description="left of the middle of the vehicle [m]")
    z_m: float = Field(ge=0, le=30, description="above the ground [m]")
    roll_deg: float = Field(default=0.0, ge=-180, le=180, description="about the forward axis, to the right [°]")
    pitch_deg: float = Field(default=0.0, ge=-90, le=90, description="about the left axis, looking down [°]")
    yaw_deg: float = Field(default=0.0, ge=-180, le=180, description="about the upward axis, to the left [°]")

    @property
    def pose(self) -> np.ndarray:
        """The carrier's axes from the sensor's own, x forward, y left, z up, (4, 4)."""
        from scipy.spatial.transform import Rotation

        matrix = np.eye(4)
        turns = (self.yaw_deg, self.pitch_deg, self.roll_deg)
        matrix[:3, :3] = Rotation.from_euler("ZYX", turns, degrees=True).as_matrix()
        matrix[:3, 3] = self.x_m, self.y_m, self.z_m
        return matrix

    @property
    def camera_pose(self) -> np.ndarray:
        """The carrier's axes from those of a camera so mounted, x right, y down, z forward, (4, 4)."""
        matrix = self.pose
        matrix[:3, :3] = matrix[:3, :3] @ CAMERA_AXES
        return matrix

    def demand_outside(self) -> None:
        """Raise ValueError for a place in a vehicle's bodywork."""
        position = (self.x_m, self.y_m, self.z_m)
        if all(low < at < high for low, at, high in zip(_BODY_LOW, position, _BODY_HIGH, strict=True)):
            raise ValueError(
                f"({self.x_m:g}, {self.y_m:g}, {self.z_m:g}) m lies inside the vehicle; "
                f"mount it above {_BODY_HIGH[2]:g} m, or beyond {_BODY_HIGH[0]:g} m of the middle"
            )


class Mount(Place):
    """A place on a vehicle, outside its bodywork."""

    @model_validator(mode="after")
    def _outside(self) -> Mount:
        self.demand_outside()
        return self
