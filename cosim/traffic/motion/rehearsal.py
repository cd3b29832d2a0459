"""Simulation of an evasive path before it is driven: its poses, and whether others occupy them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion.bicycle import BicycleState, follow
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.footprint import separation

_SPEED_MPS = 2.5
_ACCELERATION_MPS2 = 1.5
_STEP_S = 0.2


def rehearse(
    kind: str, length_m: float, way_m: float, offset: Callable[[np.ndarray], np.ndarray], heading_rad: float = 0.0
) -> np.ndarray:
    """Poses (k, 3) of a front bumper — x, y, heading — in axes at its start, x along the road.

    Args:
        kind, length_m: of the vehicle.
        way_m: how far it goes along the road.
        offset: lateral place (m,) at distances (m,) along the road, zero at the start.
        heading_rad: heading of the vehicle at the start, relative to the road.
    """
    chassis = Chassis.of((kind,), np.array([length_m]))
    state = BicycleState(np.zeros((1, 2)), np.full(1, heading_rad), np.zeros(1), np.zeros(1))
    poses, x, speed = [np.array([0.0, 0.0, heading_rad])], 0.0, 0.0
    while x < way_m:
        speed = min(speed + _ACCELERATION_MPS2 * _STEP_S, _SPEED_MPS, max(0.6, np.sqrt(3.0 * (way_m - x))))
        x += speed * _STEP_S
        y = offset(np.array([x - 0.1, x, x + 0.1]))
        travel = np.arctan((y[2:] - y[:1]) / 0.2)
        state = follow(state, chassis, np.array([[x, y[1]]]), np.zeros(1), travel, _STEP_S)
        poses.append(np.array([*state.front[0], state.heading_rad[0]]))
    return np.array(poses)


def clear(poses: np.ndarray, size: np.ndarray, boxes: np.ndarray, margin_m: float) -> bool:
    """Whether a vehicle passes boxes (k, 5: x, y, heading, length, width) at all poses, `margin_m` away."""
    middle = poses[:, :2] - size[0] / 2 * unit_vectors(poses[:, 2])
    for box in boxes:
        centre = np.vstack([middle, box[None, :2]])
        heading = np.append(poses[:, 2], box[2])
        half = np.vstack([np.tile(size[:2] / 2 + margin_m, (len(poses), 1)), box[None, 3:] / 2])
        rows = np.arange(len(poses))
        if (separation(centre, heading, half, rows, np.full(len(poses), len(poses))) > 0).any():
            return False
    return True
