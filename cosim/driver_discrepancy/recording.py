"""Samples of vehicles gathered step by step."""

from __future__ import annotations

import numpy as np

from cosim.driver_discrepancy.settings import DEFAULT
from cosim.driver_discrepancy.tracks import Tracks, gathered
from cosim.traffic.actors import Actors

_BY = DEFAULT.simulating


class TrackRecorder:
    """Gathers samples of vehicles; of those who are parked only now and then.

    Args:
        sample_s: time between two samples.
    """

    def __init__(self, sample_s: float) -> None:
        self._sample_s = sample_s
        self._next_s = -np.inf
        self._parked_s: dict[str, float] = {}
        self._ids: list[str] = []
        self._types: list[str] = []
        self._lanes: list[str] = []
        self._rows: list[np.ndarray] = []

    def add(self, actors: Actors) -> None:
        """Add the vehicles of one step."""
        if actors.time_s < self._next_s - 1e-6:
            return
        first = not np.isfinite(self._next_s)
        self._next_s = (actors.time_s if first else self._next_s) + self._sample_s
        keep = [row for row in range(len(actors)) if actors.kinds[row] != "pedestrian" and self._due(actors, row)]
        self._ids += [actors.ids[row] for row in keep]
        self._types += [actors.types[row] for row in keep]
        self._lanes += [actors.lanes[row] for row in keep]
        time_s = np.full(len(keep), actors.time_s)
        speed, heading = actors.speed_mps[keep], actors.heading_rad[keep]
        self._rows.append(np.column_stack([time_s, actors.front[keep, :2], speed, heading]))

    def tracks(self) -> Tracks:
        """All samples so far."""
        values = np.concatenate(self._rows) if self._rows else np.zeros((0, 5))
        return gathered(self._ids, self._types, self._lanes, values[:, 0], values[:, 1:3], values[:, 3], values[:, 4])

    def _due(self, actors: Actors, row: int) -> bool:
        if not actors.parked[row]:
            self._parked_s.pop(actors.ids[row], None)
            return True
        if actors.time_s < self._parked_s.get(actors.ids[row], -np.inf):
            return False
        self._parked_s[actors.ids[row]] = actors.time_s + _BY.parked_every_s
        return True
