"""What the GPS and the inertial unit of the ego vehicle measure."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from cosim.drives.kitti.oxts import Oxts
from cosim.drives.twin import Ego

_BIAS_STREAM, _NOISE_STREAM = 3, 4  # keep these random numbers apart from others of a drive


def _spread(text: str, most: float) -> float:
    return Field(default=0.0, ge=0, le=most, description=text)


class Navigation(BaseModel):
    """Errors of `oxts/`; all are zero by default. The twin keeps the truth.

    Noise is drawn anew for every frame, a bias once for an episode; both are normal about zero.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    gps_noise_m: float = _spread("standard deviation of each coordinate, frame by frame [m]", 100)
    gps_bias_m: float = _spread("standard deviation of each coordinate, for an episode [m]", 100)
    heading_noise_deg: float = _spread("standard deviation of the heading, frame by frame [°]", 45)
    velocity_noise_mps: float = _spread("standard deviation of each component of velocity [m/s]", 20)
    accelerometer_noise_mps2: float = _spread("standard deviation of each component of acceleration [m/s²]", 20)
    accelerometer_bias_mps2: float = _spread("the same for an episode [m/s²]", 20)
    gyro_noise_radps: float = _spread("standard deviation of the yaw rate [rad/s]", 5)
    gyro_bias_radps: float = _spread("the same for an episode [rad/s]", 5)

    def measured(self, ego: Ego, *, seed: int, episode: int, frame: int) -> Oxts:
        """The record of a frame.

        Args:
            ego: the truth.
            seed: of the run.
            episode, frame: their numbers, from which the errors follow.
        """
        if self == Navigation():
            return Oxts.from_motion(ego.pose, ego.velocity_mps, ego.yaw_rate_radps, ego.acceleration_mps2)
        bias = np.random.default_rng([seed, episode, _BIAS_STREAM])
        noise = np.random.default_rng([seed, frame, _NOISE_STREAM])
        pose = ego.pose.copy()
        pose[:3, 3] += self.gps_bias_m * bias.normal(size=3) + self.gps_noise_m * noise.normal(size=3)
        felt = self.accelerometer_bias_mps2 * bias.normal(size=3) + self.accelerometer_noise_mps2 * noise.normal(size=3)
        turning = self.gyro_bias_radps * bias.normal() + self.gyro_noise_radps * noise.normal()
        velocity = self.velocity_noise_mps * noise.normal(size=3)
        angle = np.radians(self.heading_noise_deg) * noise.normal()
        cos, sin = np.cos(angle), np.sin(angle)
        pose[:3, :3] = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ pose[:3, :3]
        return Oxts.from_motion(
            pose, ego.velocity_mps + velocity, ego.yaw_rate_radps + float(turning), ego.acceleration_mps2 + felt
        )
