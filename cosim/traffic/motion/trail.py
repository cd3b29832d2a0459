"""The way a point has come."""

from __future__ import annotations

import numpy as np

_LONGEST_M = 24.0
_APART_M = 0.2
_ROOM = 512  # places; what is older than the way is long is cut off when they are full


class Trail:
    """Places passed, the newest last, at least 20 cm apart, and the newest of all.

    Args:
        place: (2,) start position, world frame [m].
        heading_rad: the way it came before that.
        reach_m: length of a body that must lie on it [m].
    """

    def __init__(self, position: np.ndarray, heading_rad: float, reach_m: float = 0.0) -> None:
        self._longest_m = _LONGEST_M + reach_m
        back = position - self._longest_m * np.array([np.cos(heading_rad), np.sin(heading_rad)])
        self._places = np.empty((_ROOM, 2))
        self._places[:3] = back, position, position
        self._first, self._end = 0, 2  # the newest one is at the end
        self._last = self._second = tuple(position.tolist())

    def add(self, x: float, y: float) -> None:
        """Go on to a place."""
        last, second = self._last, self._second
        self._places[self._end] = x, y
        if (x - last[0]) ** 2 + (y - last[1]) ** 2 > _APART_M**2:
            self._last = x, y
            self._end += 1
            if self._end == _ROOM:
                self._cut()
            self._places[self._end] = x, y
        if self._end - self._first > 2 and (x - second[0]) ** 2 + (y - second[1]) ** 2 > self._longest_m**2:
            self._first += 1
            self._second = tuple(self._places[self._first + 1].tolist())

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

    def nearest(self, position: np.ndarray) -> float:
        """Distance back along the path [m] of the point nearest to a position (2,)."""
        line = self._line()
        piece = line[1:] - line[:-1]
        square = np.einsum("ij,ij->i", piece, piece)
        share = np.clip(np.einsum("ij,ij->i", position - line[:-1], piece) / np.maximum(square, 1e-12), 0, 1)
        away = line[:-1] + share[:, None] * piece - position
        i = int(np.argmin(np.einsum("ij,ij->i", away, away)))
        length = np.sqrt(square)
        return float(length[:i].sum() + share[i] * length[i])

    def _cut(self) -> None:
        kept = self._places[self._first : self._end][-_ROOM // 2 :].copy()
        self._places[: len(kept)] = kept
        self._first, self._end = 0, len(kept)

    def _line(self) -> np.ndarray:
        """Places (k, 2), the newest first, without pieces of no length."""
        line = self._places[self._first : self._end + 1][::-1]
        return line[1:] if len(line) > 2 and np.hypot(*(line[0] - line[1])) < 1e-6 else line
