"""Hidden physics of rays: unknown position, rotation and direction of the sensor head."""

from __future__ import annotations

import numpy as np

from tests.hidden.head import Aim, Beams, rotation


def mount_rotation(aim: Aim, beams: Beams, frame: dict, roll_deg=0.0, pitch_deg=0.0, yaw_deg=0.0) -> None:
    aim.mount[:3, :3] = rotation(*np.radians([roll_deg, pitch_deg, yaw_deg]))[:3, :3]


def mount_translation(aim: Aim, beams: Beams, frame: dict, x_m=0.0, y_m=0.0, z_m=0.0) -> None:
    aim.mount[:3, 3] = x_m, y_m, z_m


def elevation_offset(aim: Aim, beams: Beams, frame: dict, offset_deg: float) -> None:
    aim.elevation += np.radians(offset_deg)


def ring_elevation(aim: Aim, beams: Beams, frame: dict, offsets_deg: list[float]) -> None:
    aim.elevation += np.radians(np.asarray(offsets_deg))[beams.ring]


def encoder_eccentricity(aim: Aim, beams: Beams, frame: dict, amplitude_deg: float, phase_deg: float) -> None:
    aim.azimuth += np.radians(amplitude_deg) * np.sin(beams.azimuth + np.radians(phase_deg))


def dual_block(aim: Aim, beams: Beams, frame: dict, upper_m: float, lower_m: float) -> None:
    aim.centre_z += np.where(beams.block == 0, upper_m, lower_m)


def sweep_motion(aim: Aim, beams: Beams, frame: dict, sweep_s: float) -> None:
    # Firing times follow the column, which is what time_s says, for whatever sweep the pattern has.
    aim.after += beams.time_s * (sweep_s / frame["sweep_s"])


def time_offset(aim: Aim, beams: Beams, frame: dict, delay_s: float) -> None:
    aim.after += delay_s


def suspension_pitch(aim: Aim, beams: Beams, frame: dict, gain_deg_per_mps2: float) -> None:
    forward = np.array(frame["ego"]["pose"], float)[:3, 0]
    acceleration = float(forward @ np.array(frame["ego"]["acceleration_mps2"], float))
    aim.body = rotation(pitch=np.radians(-gain_deg_per_mps2 * acceleration))
