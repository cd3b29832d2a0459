"""Persons that sit on the seats of the street furniture: labelled objects without a part in the traffic."""

from __future__ import annotations

import numpy as np

from assets import CATALOGUE, draw_paint
from assets.models.pedestrian import HIP_BEHIND
from sensors.scene import Instances

KIND = "person_sitting"
_TURNS_RAD = np.radians(12.0)  # largest angle by which a person turns away from the seat's direction


def seat_persons(seats: np.ndarray, share: float, seed: int) -> Instances:
    """Draw the persons that sit, independently for each seat.

    Args:
        seats: (k, 4, 4) world poses of the seats: on the ground below the hips of a person that sits, x ahead.
        share: probability that a seat is taken [1].
        seed: seed of all draws; those of a seat depend only on it and on the seat's number.
    """
    specs = [spec for spec in CATALOGUE.values() if spec.kind == KIND]
    ids, chosen, poses, paints = [], [], [], []
    for number, seat in enumerate(seats):
        rng = np.random.default_rng([seed, number])
        if rng.random() >= share:
            continue
        spec = specs[int(rng.integers(len(specs)))]
        ids.append(f"sitting{number}")
        chosen.append(spec)
        poses.append(seat @ _turned(float(rng.uniform(-_TURNS_RAD, _TURNS_RAD)), HIP_BEHIND * spec.length_m))
        paints.append(draw_paint(KIND, rng))
    n = len(ids)
    return Instances(
        ids=tuple(ids),
        kinds=(KIND,) * n,
        models=tuple(spec.name for spec in chosen),
        poses=np.array(poses).reshape(-1, 4, 4),
        scales=np.ones((n, 3)),
        sizes=np.array([spec.size_m for spec in chosen]).reshape(-1, 3),
        velocity_mps=np.zeros((n, 3)),
        yaw_rate_radps=np.zeros(n),
        paint=np.array([paint.reflectance for paint in paints], np.float32),
        rgb=np.array([paint.rgb for paint in paints], np.float32).reshape(-1, 3),
    )


def _turned(angle_rad: float, ahead_m: float) -> np.ndarray:
    """Pose (4, 4) of the middle of a box whose hips, `ahead_m` behind it, stay in place."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    pose = np.eye(4)
    pose[:2, :2] = [[cos, -sin], [sin, cos]]
    pose[:2, 3] = ahead_m * cos, ahead_m * sin
    return pose
