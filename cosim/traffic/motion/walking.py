"""People on foot: their steps carry on smoothly where SUMO's stripes and walking areas meet."""

from __future__ import annotations

import numpy as np

_RESPONSE_S = 0.35
_MAX_SPEED_MPS = 3.0
_MAX_ACCELERATION_MPS2 = 4.0
_TURN_RADPS = np.radians(200.0)
_TURNS_TOWARDS_ITS_WAY_MPS = 0.25


def walk(
    position: np.ndarray,
    velocity: np.ndarray,
    heading_rad: np.ndarray,
    target: np.ndarray,
    raw_heading_rad: np.ndarray,
    step_s: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One step after the targets.

    Args:
        position, velocity: (n, 2) world, metres and m/s.
        heading_rad: (n,).
        target: (n, 2) where SUMO has them.
        raw_heading_rad: (n,) SUMO's heading, used for stationary people.
        step_s: length of the step.

    Returns:
        New position, velocity and heading.
    """
    wanted = (target - position) / _RESPONSE_S
    wanted = _shorten(wanted, _MAX_SPEED_MPS)
    velocity = velocity + _shorten(wanted - velocity, _MAX_ACCELERATION_MPS2 * step_s)
    speed = np.linalg.norm(velocity, axis=1)
    goes = speed > _TURNS_TOWARDS_ITS_WAY_MPS
    looks = np.where(goes, np.arctan2(velocity[:, 1], velocity[:, 0]), raw_heading_rad)
    turn = (looks - heading_rad + np.pi) % (2 * np.pi) - np.pi
    largest = _TURN_RADPS * step_s
    heading_rad = heading_rad + np.clip(0.5 * turn, -largest, largest)
    return position + velocity * step_s, velocity, (heading_rad + np.pi) % (2 * np.pi) - np.pi


def _shorten(vectors: np.ndarray, longest: float) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors * np.minimum(1.0, longest / np.maximum(length, 1e-9))
