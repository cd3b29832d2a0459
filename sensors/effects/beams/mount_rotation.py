"""Rotation of the whole sensor in its mount."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, number
from sensors.effects.phases import Phase
from sensors.shot import Shot


class MountRotation(BeamEffect):
    """True LiDAR pose = nominal pose · R, R = Rz(yaw)·Ry(pitch)·Rx(roll), right-handed about x forward, y left, z up.

    Points are still written along nominal directions, so that the rotation changes ranges. Pitch > 0 is nose down.
    """

    name: ClassVar = "mount_rotation"
    phase: ClassVar = Phase.MOUNT
    channel: ClassVar = "pose"
    equation: ClassVar = "T_true = T · Rz(yaw)·Ry(pitch)·Rx(roll)"
    reference: ClassVar = "Levinson, Thrun: Automatic online calibration of cameras and lasers, RSS 2013"
    confusable_with: ClassVar = ("elevation_offset", "suspension_pitch", "encoder_eccentricity")
    example: ClassVar = {"roll_deg": 0.0, "pitch_deg": 1.0, "yaw_deg": 0.0}
    neutral: ClassVar = {"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0}

    roll_deg: float = number("turn about the forward axis, left side up", unit="°", ge=-20, le=20)
    pitch_deg: float = number("turn about the left axis, nose down", unit="°", ge=-20, le=20)
    yaw_deg: float = number("turn about the up axis, to the left", unit="°", ge=-180, le=180)

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return beams with a rotated mount."""
        roll, pitch, yaw = np.radians([self.roll_deg, self.pitch_deg, self.yaw_deg])
        turn = np.eye(4)
        turn[:3, :3] = about(2, yaw) @ about(1, pitch) @ about(0, roll)
        return replace(beams, mount=beams.mount @ turn)


def about(axis: int, angle_rad: float) -> np.ndarray:
    """Right-handed rotation (3, 3) about a coordinate axis: 0 x, 1 y, 2 z."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle_rad)
    matrix[j, i] = np.sin(angle_rad)
    matrix[i, j] = -matrix[j, i]
    return matrix
