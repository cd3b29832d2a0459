"""The rear-axle bicycle: follow a moving point with the front bumper, as far as wheels and grip allow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion.chassis import Chassis

MAX_LATERAL_MPS2 = 6.0
MAX_YAW_RATE_RADPS = 0.95
_MAX_ACCELERATION_MPS2 = 6.0
_MAX_BRAKING_MPS2 = 12.0
_LOOK_AHEAD_S = 0.55  # beyond the bumper, at speeds above _CALM_MPS
_CALM_MPS = 5.0
_CORRECTION_M = 1.6  # distance over which an error of direction is taken back
_STANDS_M = 1e-4


@dataclass(eq=False)
class BicycleState:
    """n vehicles.

    Attributes:
        front: (n, 2) front bumper's centre, world metres.
        heading_rad: (n,) counter-clockwise from east.
        curvature_per_m: (n,) of the rear axle's path, positive to the left.
        speed_mps: (n,) of the rear axle.
    """

    front: np.ndarray
    heading_rad: np.ndarray
    curvature_per_m: np.ndarray
    speed_mps: np.ndarray


def follow(
    state: BicycleState,
    chassis: Chassis,
    target: np.ndarray,
    course_rad: np.ndarray,
    travel_rad: np.ndarray,
    step_s: float,
    pace_mps: np.ndarray | None = None,
) -> BicycleState:
    """One step of vehicles whose guiding points (`Chassis.guide_m`) head for the targets.

    The rear axle moves along an arc: dx = ds·cos(θ + κ·ds/2), dθ = κ·ds (kinematic bicycle with the reference on the
    rear axle; Rajamani, Vehicle Dynamics and Control, § 2.2). The curvature that keeps a rod's tip on its way, that of
    the tractrix, κ = sin(φ − θ)/L, is fed forward; what is left of the direction's error is taken back over a
    constant distance.

    Args:
        state: before.
        chassis: of the vehicles.
        target: (n, 2) where the guiding points should be after the step, world metres.
        course_rad: (n,) direction of the road at the target.
        travel_rad: (n,) direction in which the target moves.
        step_s: length of the step.
        pace_mps: (n,) speed of those who only look towards their targets, NaN for those who should arrive there.
    """
    rear = chassis.rear_m
    arm = rear - chassis.guide_m
    theta, kappa = state.heading_rad, state.curvature_per_m
    forward = unit_vectors(theta)
    middle = theta + 0.5 * kappa * np.clip(state.speed_mps, 0, None) * step_s
    error = target - state.front + chassis.guide_m[:, None] * forward
    along = error[:, 0] * np.cos(middle) + error[:, 1] * np.sin(middle)
    if pace_mps is not None:
        along = np.where(np.isnan(pace_mps), along, pace_mps * step_s)
    fastest = state.speed_mps + _MAX_ACCELERATION_MPS2 * step_s
    slowest = np.maximum(state.speed_mps - _MAX_BRAKING_MPS2 * step_s, 0)
    ds = np.clip(along / step_s, slowest, np.maximum(fastest, slowest)) * step_s
    speed = ds / step_s

    beyond = _LOOK_AHEAD_S * np.maximum(speed - _CALM_MPS, 0)
    ahead = unit_vectors(course_rad) * beyond[:, None]
    rod = arm + beyond
    axle = state.front - rear[:, None] * forward
    moved = axle + ds[:, None] * unit_vectors(middle)
    to_target = target + ahead - moved
    off = wrap(np.arctan2(to_target[:, 1], to_target[:, 0]) - theta)
    wanted = np.sin(np.clip(wrap(travel_rad - theta), -1.3, 1.3)) / rod
    wanted = wanted + np.clip(off, -0.6, 0.6) / (_CORRECTION_M + 0.25 * beyond)

    quick = np.maximum(np.abs(speed), 0.5)
    limit = np.minimum(chassis.max_curvature_per_m, MAX_LATERAL_MPS2 / quick**2)
    limit = np.minimum(limit, MAX_YAW_RATE_RADPS / quick)
    rate = chassis.max_curvature_rate_per_ms * step_s
    wanted = np.clip(wanted, kappa - rate, kappa + rate)
    wanted = np.clip(wanted, -limit, limit)
    moves = ds > _STANDS_M
    wanted = np.where(moves, wanted, kappa)

    turned = wanted * ds
    axle = axle + ds[:, None] * unit_vectors(theta + turned / 2)
    theta = theta + turned
    front = axle + rear[:, None] * unit_vectors(theta)
    front = np.where(moves[:, None], front, state.front)
    return BicycleState(front, np.where(moves, wrap(theta), state.heading_rad), wanted, np.where(moves, speed, 0.0))


def wrap(angle: np.ndarray) -> np.ndarray:
    """Angles [rad] within a half turn of zero."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
