"""The way a point has come."""

from __future__ import annotations

from collections import deque

import numpy as np

_LONGEST_M = 16.0
_APART_M = 0.05


class Trail:
    """Places passed, the newest last, at least 5 cm apart.

    Args:
        place: (2,) where it begins, world metres.
        heading_rad: the way it came before that.
    """

    def __init__(self, place: np.ndarray, heading_rad: float) -> None:
        back = place - _LONGEST_M * np.array([np.cos(heading_rad), np.sin(heading_rad)])
        self._places = deque([back, np.array(place)])
        self._head = np.array(place)

    def add(self, place: np.ndarray) -> None:
        """Go on to a place (2,)."""
        self._head = np.array(place)
        if np.hypot(*(self._head - self._places[-1])) > _APART_M:
            self._places.append(self._head)
        while len(self._places) > 2 and np.hypot(*(self._head - self._places[1])) > _LONGEST_M:
            self._places.popleft()

    def behind(self, distance_m: float) -> tuple[np.ndarray, float]:
        """The place (2,) at a distance back along the way, and the direction of the way there [rad]."""
        after = self._head
        for place in reversed(self._places):
            piece = after - place
            length = float(np.hypot(*piece))
            if length > 1e-6 and length >= distance_m:
                return after - piece * distance_m / length, float(np.arctan2(piece[1], piece[0]))
            distance_m -= length
            after = place
        piece = self._places[1] - self._places[0]
        return self._places[0], float(np.arctan2(piece[1], piece[0]))
