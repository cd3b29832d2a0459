"""A manoeuvre written beforehand: a pose for every step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion.stopping import Stops

_GIVES_UP_STEPS = 15
_PAUSES_STEPS = 3  # from full pace to a halt; scripts are walking pace


@dataclass(frozen=True, eq=False)
class Script:
    """Poses of a front bumper, one a step.

    Attributes:
        front: (k, 2) world metres.
        heading_rad: (k,).
    """

    front: np.ndarray
    heading_rad: np.ndarray

    def __len__(self) -> int:
        return len(self.front)


class Player:
    """Plays a script, pausing where it must.

    Args:
        script: to play.
        front: (2,) start position.
        heading_rad: the heading there.
        retreat: whether the vehicle gives way thereby: it gives up if it cannot go on, and follows SUMO as before.
    """

    def __init__(self, script: Script, front: np.ndarray, heading_rad: float, *, retreat: bool = False) -> None:
        self.retreat = retreat
        self._paused = 0
        self._front = np.vstack([front, script.front])
        self._heading = np.unwrap(np.concatenate([[heading_rad], script.heading_rad]))
        self._at = 0.0
        self._pace = 0  # in shares of 1 / _PAUSES_STEPS

    @property
    def steps_left(self) -> float:
        """Smallest number of steps to its end."""
        if self.retreat and self._paused > _GIVES_UP_STEPS:
            return 0.0
        return len(self._front) - 1 - self._at

    def pose(self) -> tuple[np.ndarray, float]:
        """Front bumper (2,) and heading now."""
        front, heading = self._poses(np.array([self._at]))
        return front[0], float(heading[0])

    def go(self) -> None:
        """Go on by a step."""
        self._paused = 0
        self._pace = min(self._pace + 1, _PAUSES_STEPS)
        self._at = min(self._at + self._pace / _PAUSES_STEPS, len(self._front) - 1.0)

    def slow_down(self) -> None:
        """Go on by a step towards a halt."""
        self._paused += 1
        self._pace = max(self._pace - 1, 0)
        self._at = min(self._at + self._pace / _PAUSES_STEPS, len(self._front) - 1.0)

    def stops(self, length_m: float, *, goes_on: bool) -> Stops:
        """Boxes after a step that goes on or slows down, and until rest."""
        pace = min(self._pace + 1, _PAUSES_STEPS) if goes_on else max(self._pace - 1, 0)
        ways = np.cumsum(np.arange(pace, -1, -1)) / _PAUSES_STEPS
        front, heading = self._poses(np.minimum(self._at + ways[: max(pace, 1)], len(self._front) - 1.0))
        forward = unit_vectors(heading)
        centre = front - length_m / 2 * forward
        return Stops(centre[None], heading[None], np.array([len(heading) - 1]))

    def _poses(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        known = np.arange(len(self._front))
        front = np.column_stack([np.interp(at, known, self._front[:, i]) for i in (0, 1)])
        return front, np.interp(at, known, self._heading)
