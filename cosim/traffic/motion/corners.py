"""Comfortable speeds in the bends of a network."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

_COMFORT_MPS2 = 2.8
_YAW_RATE_RADPS = 0.6
_WINDOW_M = 4.0
_STEP_M = 0.5
_SLOWEST_MPS = 2.5
_OFF_LANE_M = 1.1
_REAR_AXLE = 0.74  # of a truck, share of its length


def sharpest_radius(shape: np.ndarray) -> float:
    """Radius of a lane's sharpest bend [m], over 4 m of way; infinite on a straight one.

    Args:
        shape: (k, 2 or 3) middle line, metres.
    """
    xy = np.asarray(shape, float)[:, :2]
    pieces = np.diff(xy, axis=0)
    lengths = np.hypot(pieces[:, 0], pieces[:, 1])
    pieces, lengths = pieces[lengths > 1e-3], lengths[lengths > 1e-3]
    if len(pieces) < 2:
        return float("inf")
    heading = np.unwrap(np.arctan2(pieces[:, 1], pieces[:, 0]))
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    window = min(_WINDOW_M, 0.7 * at[-1])
    middle = (at[:-1] + at[1:]) / 2
    start = np.arange(0.0, max(at[-1] - window, 0.0) + _STEP_M, _STEP_M)
    turned = np.interp(start + window, middle, heading) - np.interp(start, middle, heading)
    curvature = float(np.abs(turned).max()) / window
    return float("inf") if curvature < 1e-3 else 1 / curvature


def corner_speed(shape: np.ndarray) -> float:
    """Speed at which a vehicle takes a lane's sharpest bend [m/s]; infinite on a straight one.

    Lateral acceleration κ·v² stays within 2.8 m/s², about what drivers accept in towns, and the yaw rate κ·v within
    0.6 rad/s.

    Args:
        shape: (k, 2 or 3) middle line, metres.
    """
    radius = _radius_of(np.asarray(shape, float)[:, :2].tobytes())
    if radius == float("inf"):
        return radius
    return max(min(np.sqrt(_COMFORT_MPS2 * radius), _YAW_RATE_RADPS * radius), _SLOWEST_MPS)


@lru_cache(maxsize=8192)  # lanes of a few towns: every episode needs them again
def _radius_of(xy: bytes) -> float:
    return sharpest_radius(np.frombuffer(xy).reshape(-1, 2))


def longest_body(radius_m: float) -> float:
    """Length of a rigid body that takes a long bend with its ends at most 1.1 m off its lane [m].

    The rear axle, a = 0.74 of the length behind the bumper, runs R − √(R² − a²) farther inside (Rajamani, Vehicle
    Dynamics and Control, § 2.2); swinging out first, half of it falls to either side.
    """
    return float(np.sqrt(max(4 * _OFF_LANE_M * (radius_m - _OFF_LANE_M), 0.0)) / _REAR_AXLE)
