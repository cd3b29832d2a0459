"""Turning round in the road: one arc where it is wide enough, three or five with changes of gear elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.errors import CosimError
from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion.bicycle import MAX_YAW_RATE_RADPS
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.footprint import separation
from cosim.traffic.motion.script import Script

WAY_STEP_M = 0.04  # between poses of a way
_MOST_ARCS = 5
_SHORTEST_ARC_M = 0.35
_LOCK = 0.93  # share of the largest curvature
_ACCELERATION_MPS2 = 1.3
SPEED_MPS = {1: 1.9, -1: 1.3}  # forwards and backwards
PAUSE_S = 0.7  # change gear, turn the wheel
_CLEAR_M = 0.15  # of other road users


class TurnError(CosimError):
    """There is no room to turn round."""


@dataclass(frozen=True, eq=False)
class Room:
    """Area in which a vehicle may turn, in axes at its front bumper: x forward, y left.

    Attributes:
        right_m, left_m: lateral bounds of its corners (right_m < 0).
        goal_m: lateral position of the lane it turns into.
        boxes: (k, 5) other stationary vehicles: x, y, heading, length, width.
    """

    right_m: float
    left_m: float
    goal_m: float
    boxes: np.ndarray


def plan_turn(front: np.ndarray, heading_rad: float, kind: str, size: np.ndarray, room: Room, step_s: float) -> Script:
    """Turn round to the left from a standstill, ending at a standstill in the opposite direction.

    Every arc is driven at nearly full lock until a corner would leave the room, or, backwards, until the next forward
    arc ends in the middle of the goal lane. At its ends, with the wheels turned at rest, curvature may jump.

    Args:
        front: (2,) front bumper's centre, world metres.
        heading_rad: along the road.
        kind: of vehicle.
        size: (3,) length, width, height [m].
        room: where it may turn.
        step_s: time between poses.

    Raises:
        TurnError: no room within five arcs.
    """
    chassis = Chassis.of((kind,), np.array([size[0]]))
    rear_m, curvature = float(chassis.rear_m[0]), float(chassis.max_curvature_per_m[0]) * _LOCK
    pose = np.array([-rear_m, 0.0, 0.0])
    poses: list[np.ndarray] = []
    gear = 1
    for _ in range(_MOST_ARCS):
        arc = _arc(pose, gear, curvature, rear_m, size, room)
        if (len(arc) - 1) * WAY_STEP_M < _SHORTEST_ARC_M and arc[-1, 2] < np.pi:
            break
        poses.append(drive(arc, min(SPEED_MPS[gear], MAX_YAW_RATE_RADPS / curvature), step_s))
        pose = arc[-1]
        if pose[2] >= np.pi:
            return as_script(np.concatenate(poses), front, heading_rad, rear_m)
        poses.append(np.repeat(pose[None], round(PAUSE_S / step_s), axis=0))
        gear = -gear
    width = room.left_m - room.right_m
    raise TurnError(f"a {kind} of {size[0]:.1f} m cannot turn round within {width:.1f} m; take another place")


def _arc(pose: np.ndarray, gear: int, curvature: float, rear_m: float, size: np.ndarray, room: Room) -> np.ndarray:
    """Rear-axle poses (k, 3) along one arc, as far as there is room."""
    steps = int(np.pi / curvature / WAY_STEP_M) + 2
    way = gear * WAY_STEP_M * np.arange(steps)
    heading = np.minimum(pose[2] + gear * curvature * way, np.pi)  # backwards the wheels are turned the other way
    curve = gear * curvature
    x = pose[0] + (np.sin(heading) - np.sin(pose[2])) / curve
    y = pose[1] - (np.cos(heading) - np.cos(pose[2])) / curve
    arc = np.column_stack([x, y, heading])
    ends = (heading >= np.pi) | ~_fits(arc, rear_m, size, room)
    if gear < 0:
        ends |= y + (1 + np.cos(heading)) / curvature <= room.goal_m
    first = int(np.argmax(ends)) if ends.any() else steps - 1
    arrives = heading[first] >= np.pi
    return arc[: first + 1] if arrives else arc[: max(first, 1)]


def _fits(arc: np.ndarray, rear_m: float, size: np.ndarray, room: Room) -> np.ndarray:
    cos, sin = np.cos(arc[:, 2]), np.sin(arc[:, 2])
    middle = arc[:, :2] + (rear_m - size[0] / 2) * np.column_stack([cos, sin])
    reach = np.abs(sin) * size[0] / 2 + np.abs(cos) * size[1] / 2
    fits = (middle[:, 1] + reach <= room.left_m) & (middle[:, 1] - reach >= room.right_m)
    for box in room.boxes:
        centre = np.vstack([middle, box[None, :2]])
        heading = np.append(arc[:, 2], box[2])
        half = np.vstack([np.tile(size[:2] / 2 + _CLEAR_M, (len(arc), 1)), box[None, 3:] / 2])
        rows = np.arange(len(arc))
        fits &= separation(centre, heading, half, rows, np.full(len(arc), len(arc))) <= 0
    return fits


def drive(arc: np.ndarray, fastest_mps: float, step_s: float) -> np.ndarray:
    """Poses (k, 3) along a way of poses (n, 3) `WAY_STEP_M` apart, one a time step, from rest to rest."""
    length = (len(arc) - 1) * WAY_STEP_M
    top = min(fastest_mps, np.sqrt(_ACCELERATION_MPS2 * length))
    ramp_s = top / _ACCELERATION_MPS2
    total_s = length / top + ramp_s
    time = np.arange(1, int(np.ceil(total_s / step_s)) + 1) * step_s
    gone = np.where(
        time < ramp_s,
        0.5 * _ACCELERATION_MPS2 * time**2,
        np.where(
            time < total_s - ramp_s,
            top * (time - ramp_s / 2),
            length - 0.5 * _ACCELERATION_MPS2 * np.maximum(total_s - time, 0) ** 2,
        ),
    )
    way = WAY_STEP_M * np.arange(len(arc))
    return np.column_stack([np.interp(gone, way, arc[:, i]) for i in range(3)])


def as_script(poses: np.ndarray, front: np.ndarray, heading_rad: float, rear_m: float) -> Script:
    """Rear-axle poses (k, 3) in axes at `front` (2,), x along `heading_rad`, as a script in the world."""
    tip = poses[:, :2] + rear_m * unit_vectors(poses[:, 2])
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    world = np.column_stack([tip[:, 0] * cos - tip[:, 1] * sin, tip[:, 0] * sin + tip[:, 1] * cos]) + front
    heading = poses[:, 2] + heading_rad
    return Script(world, (heading + np.pi) % (2 * np.pi) - np.pi)
