"""Measurements of the GPS and the inertial measurement unit of the ego vehicle."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from cosim.drives.kitti.oxts import Oxts
from cosim.drives.twin import Ego

_BIAS_STREAM, _NOISE_STREAM = 3, 4  # keep these random numbers apart from others of a drive


def _standard_deviation(text: str, maximum: float) -> float:
    return Field(default=0.0, ge=0, le=maximum, description=f"standard deviation of {text}")


class Navigation(BaseModel):
    """Errors of the measurements in `oxts/`; all are zero by default. The twin contains the true motion.

    Noise is drawn independently for every frame, a bias once per episode; both are normal with mean zero.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    gps_noise_m: float = _standard_deviation("the noise of each coordinate [m]", 100)
    gps_bias_m: float = _standard_deviation("the bias of each coordinate [m]", 100)
    heading_noise_deg: float = _standard_deviation("the noise of the heading [°]", 45)
    velocity_noise_mps: float = _standard_deviation("the noise of each velocity component [m/s]", 20)
    accelerometer_noise_mps2: float = _standard_deviation("the noise of each acceleration component [m/s²]", 20)
    accelerometer_bias_mps2: float = _standard_deviation("the bias of each acceleration component [m/s²]", 20)
    gyro_noise_radps: float = _standard_deviation("the noise of the yaw rate [rad/s]", 5)
    gyro_bias_radps: float = _standard_deviation("the bias of the yaw rate [rad/s]", 5)

    def measured(self, ego: Ego, *, seed: int, episode: int, frame: int) -> Oxts:
        """Simulate the OXTS record of a frame.

        Args:
            ego: true pose and motion.
            seed: seed of the run.
            episode, frame: numbers of episode and frame; they seed the errors together with `seed`.
        """
        if self == Navigation():
            return Oxts.from_motion(ego.pose, ego.velocity_mps, ego.yaw_rate_radps, ego.acceleration_mps2)
        bias = np.random.default_rng([seed, episode, _BIAS_STREAM])
        noise = np.random.default_rng([seed, frame, _NOISE_STREAM])
        pose = ego.pose.copy()
        pose[:3, 3] += self.gps_bias_m * bias.normal(size=3) + self.gps_noise_m * noise.normal(size=3)
        acceleration_error = self.accelerometer_bias_mps2 * bias.normal(
            size=3
        ) + self.accelerometer_noise_mps2 * noise.normal(size=3)
        yaw_rate_error = self.gyro_bias_radps * bias.normal() + self.gyro_noise_radps * noise.normal()
        velocity_error = self.velocity_noise_mps * noise.normal(size=3)
        angle = np.radians(self.heading_noise_deg) * noise.normal()
        cos, sin = np.cos(angle), np.sin(angle)
        pose[:3, :3] = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ pose[:3, :3]
        return Oxts.from_motion(
            pose,
            ego.velocity_mps + velocity_error,
            ego.yaw_rate_radps + float(yaw_rate_error),
            ego.acceleration_mps2 + acceleration_error,
        )
