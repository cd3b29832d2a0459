"""Backwards out of the way: along the poses a vehicle came by."""

from __future__ import annotations

from collections import deque

import numpy as np

from cosim.traffic.motion.script import Script

APART_M = 0.1
_LONGEST = 60  # poses
_SHORTEST_M = 0.6
_STEP_M = 0.1  # 1 m/s
_SOFT_STEPS = 5
_THERE_M = 0.01


class Footsteps:
    """The last poses of one vehicle, about 10 cm apart."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, float, float]] = deque(maxlen=_LONGEST)

    def add(self, x: float, y: float, heading_rad: float) -> None:
        """Note where the front bumper is, unless that is where it was."""
        if not self._poses or (x - self._poses[-1][0]) ** 2 + (y - self._poses[-1][1]) ** 2 > APART_M**2:
            self._poses.append((x, y, heading_rad))

    def clear(self) -> None:
        """Forget them: the way back has been driven."""
        self._poses.clear()

    def back(self, position: np.ndarray, heading_rad: float, way_m: float, hold_steps: int) -> Script | None:
        """The way back from a place (2,), at walking pace, and a rest; None where it is too short."""
        line = np.array([(*position.tolist(), heading_rad), *reversed(self._poses)]).reshape(-1, 3)
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])
        line[:, 2] = np.unwrap(line[:, 2])
        end = min(way_m, float(way[-1]))
        if end < _SHORTEST_M:
            return None
        at = np.array(_from_rest_to_rest(end))
        at = np.concatenate([at, np.full(hold_steps, end)])
        poses = np.column_stack([np.interp(at, way, line[:, i]) for i in range(3)])
        return Script(poses[:, :2], poses[:, 2])


def _from_rest_to_rest(way_m: float) -> list[float]:
    """Distances gone after the steps of a way."""
    gone, pace, eases = [0.0], 0.0, _STEP_M / _SOFT_STEPS
    while way_m - gone[-1] > _THERE_M:
        left = way_m - gone[-1]
        pace = min(pace + eases, _STEP_M, max(float(np.sqrt(2 * eases * left)) - eases / 2, _THERE_M))
        gone.append(min(gone[-1] + pace, way_m))
    return [*gone[1:], way_m]
