"""Backing into a place at the kerb: past it, then backwards in two arcs."""

from __future__ import annotations

import numpy as np

from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion.bicycle import MAX_YAW_RATE_RADPS
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.rehearsal import clear
from cosim.traffic.motion.script import Script
from cosim.traffic.motion.turn_path import PAUSE_S, SPEED_MPS, WAY_STEP_M, as_script, drive

_LOCKS = (0.6, 0.75, 0.93)  # shares of the largest curvature
_STEEPEST = 0.5  # cosine of the largest angle against the kerb


def plan_backing_in(
    front: np.ndarray,
    heading_rad: float,
    kind: str,
    size: np.ndarray,
    position: np.ndarray,
    askew_rad: float,
    boxes: np.ndarray,
    margin_m: float,
    step_s: float,
) -> Script | None:
    """Go past a place and back into it on the right, from a standstill to a standstill along the kerb.

    Both arcs have the same radius; the angle between them follows from how far to the side the place lies. The
    gentlest way that is clear is taken.

    Args:
        front: (2,) front bumper's centre, world metres.
        heading_rad: along the kerb.
        kind: of vehicle.
        size: (3,) length, width, height [m].
        position: (2,) final position of the front bumper, in axes at `front`, x along the kerb.
        askew_rad: heading at the start, against the kerb.
        boxes: (k, 5) others, in the same axes: x, y, heading, length, width.
        margin_m: kept free of them.
        step_s: time between poses.

    Returns:
        None where there is no room.
    """
    chassis = Chassis.of((kind,), np.array([size[0]]))
    rear_m, most = float(chassis.rear_m[0]), float(chassis.max_curvature_per_m[0])
    for lock in _LOCKS:
        way = _way(lock * most, rear_m, position, askew_rad)
        if way is None:
            continue
        axle = np.concatenate(way)
        tips = axle[:, :2] + rear_m * unit_vectors(axle[:, 2])
        if not clear(np.column_stack([tips, axle[:, 2]])[::5], size, boxes, margin_m):
            continue
        poses = []
        for part, gear in zip(way, (1, -1, -1), strict=True):
            poses.append(drive(part, min(SPEED_MPS[gear], MAX_YAW_RATE_RADPS / (lock * most)), step_s))
            poses.append(np.repeat(part[-1:], round(PAUSE_S / step_s), axis=0))
        return as_script(np.concatenate(poses), front, heading_rad, rear_m)
    return None


def _way(curvature: float, rear_m: float, position: np.ndarray, askew: float) -> list[np.ndarray] | None:
    """Rear-axle poses (k, 3) forwards, and along both arcs backwards; None where these cannot lead to the place."""
    begin, goal_x = -rear_m * np.array([np.cos(askew), np.sin(askew)]), position[0] - rear_m
    begin = np.array([begin[0], begin[1]])
    past = 0.0
    for _ in range(3):  # a rotated vehicle gets closer to the kerb as it passes, or farther away
        aside = begin[1] + past * np.sin(askew) - position[1]
        cosine = (1 + np.cos(askew) - curvature * aside) / 2
        if not _STEEPEST < cosine < 1:
            return None
        steep = float(np.arccos(cosine))
        past = goal_x + (2 * np.sin(steep) - np.sin(askew)) / curvature - begin[0]
    if past < 1.0 or steep <= askew:
        return None
    way = np.linspace(0, past, _poses(past))
    forth = np.column_stack([begin[0] + way * np.cos(askew), begin[1] + way * np.sin(askew), np.full(len(way), askew)])
    out = _arc(forth[-1], askew, steep, curvature)
    return [forth, out, _arc(out[-1], steep, 0.0, -curvature)]


def _arc(pose: np.ndarray, heading: float, until: float, curvature: float) -> np.ndarray:
    turned = np.linspace(heading, until, _poses((until - heading) / curvature))
    x = pose[0] - (np.sin(turned) - np.sin(heading)) / curvature
    y = pose[1] + (np.cos(turned) - np.cos(heading)) / curvature
    return np.column_stack([x, y, turned])


def _poses(way_m: float) -> int:
    return max(round(way_m / WAY_STEP_M), 2) + 1
