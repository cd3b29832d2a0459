"""Vehicles on rails: both bogies stay on the line that SUMO's vehicle takes."""

from __future__ import annotations

import numpy as np

from cosim.traffic.motion.bicycle import BicycleState, wrap
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.trail import Trail

_MAX_ACCELERATION_MPS2, _MAX_BRAKING_MPS2 = 2.5, 6.0
_MAX_CURVATURE_PER_M = 0.1
_MOVES_M = 1e-4


def roll(wanted: BicycleState, state: BicycleState, i: int, chassis: Chassis, trail: Trail, step_s: float) -> float:
    """Set the wanted state of one vehicle so that its body is the chord between two bogies on a trail.

    Args:
        wanted: n vehicles after the step; row `i` is set.
        state: the same before the step.
        i: row of the vehicle.
        chassis: of the n vehicles; the front bogie is as far behind the front as the rear bogie is before the rear.
        trail: of the front bumper's target.
        step_s: length of the step [s].

    Returns:
        Distance that remains to the target [m].
    """
    rear_m = float(chassis.rear_m[i])
    guide_m = float(chassis.length_m[i]) - rear_m
    theta, speed = float(state.heading_rad[i]), float(state.speed_mps[i])
    bogie = state.front[i] - guide_m * np.array([np.cos(theta), np.sin(theta)])
    left_m = max(trail.nearest(bogie) - guide_m, 0.0)
    slowest, fastest = speed - _MAX_BRAKING_MPS2 * step_s, speed + _MAX_ACCELERATION_MPS2 * step_s
    ds = float(np.clip(left_m, max(slowest, 0.0) * step_s, max(fastest, 0.0) * step_s))
    if ds < _MOVES_M:
        wanted.front[i], wanted.heading_rad[i] = state.front[i], theta
        wanted.curvature_per_m[i], wanted.speed_mps[i] = state.curvature_per_m[i], 0.0
        return left_m
    behind_m = max(left_m - ds, 0.0)
    head, tail = (trail.behind(behind_m + at)[0] for at in (guide_m, rear_m))
    heading = float(np.arctan2(head[1] - tail[1], head[0] - tail[0]))
    turned = float(wrap(np.array(heading - theta)))
    wanted.front[i] = head + guide_m * np.array([np.cos(heading), np.sin(heading)])
    wanted.heading_rad[i], wanted.speed_mps[i] = heading, ds / step_s
    wanted.curvature_per_m[i] = np.clip(turned / ds, -_MAX_CURVATURE_PER_M, _MAX_CURVATURE_PER_M)
    return behind_m
