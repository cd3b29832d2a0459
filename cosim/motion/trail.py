"""The way a point has come."""

from __future__ import annotations

from collections import deque

import numpy as np

_LONGEST_M = 24.0
_APART_M = 0.2


class Trail:
    """Places passed, the newest last, at least 20 cm apart.

    Args:
        place: (2,) where it begins, world metres.
        heading_rad: the way it came before that.
    """

    def __init__(self, place: np.ndarray, heading_rad: float) -> None:
        back = place - _LONGEST_M * np.array([np.cos(heading_rad), np.sin(heading_rad)])
        self._places: deque[tuple[float, float]] = deque([tuple(back.tolist()), tuple(place.tolist())])
        self._head: tuple[float, float] = tuple(place.tolist())

    def add(self, x: float, y: float) -> None:
        """Go on to a place."""
        self._head = (x, y)
        last, second = self._places[-1], self._places[1]
        if (x - last[0]) ** 2 + (y - last[1]) ** 2 > _APART_M**2:
            self._places.append(self._head)
        if len(self._places) > 2 and (x - second[0]) ** 2 + (y - second[1]) ** 2 > _LONGEST_M**2:
            self._places.popleft()

    def behind(self, distance_m: float) -> tuple[np.ndarray, float]:
        """The place (2,) at a distance back along the way, and the direction of the way there [rad]."""
        line = self._line()
        piece = line[:-1] - line[1:]
        length = np.hypot(piece[:, 0], piece[:, 1])
        way = np.cumsum(length)
        i = min(int(np.searchsorted(way, distance_m)), len(way) - 1)
        over = min(distance_m - (way[i] - length[i]), length[i])
        direction = piece[i] / max(length[i], 1e-9)
        return line[i] - over * direction, float(np.arctan2(direction[1], direction[0]))

    def nearest(self, place: np.ndarray) -> float:
        """How far back along the way it comes nearest to a place (2,) [m]."""
        line = self._line()
        piece = line[1:] - line[:-1]
        square = np.einsum("ij,ij->i", piece, piece)
        share = np.clip(np.einsum("ij,ij->i", place - line[:-1], piece) / np.maximum(square, 1e-12), 0, 1)
        away = line[:-1] + share[:, None] * piece - place
        i = int(np.argmin(np.einsum("ij,ij->i", away, away)))
        length = np.sqrt(square)
        return float(length[:i].sum() + share[i] * length[i])

    def _line(self) -> np.ndarray:
        """Places (k, 2), the newest first, without pieces of no length."""
        line = np.array([self._head, *reversed(self._places)])
        return line[1:] if len(line) > 2 and np.hypot(*(line[0] - line[1])) < 1e-6 else line
