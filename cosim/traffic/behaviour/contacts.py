"""Contacts: overlaps of vehicles that no configured collision explains."""

from __future__ import annotations

import numpy as np

from cosim.traffic.behaviour.stage import Stage
from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion import overlaps

_FORGETS_S = 10.0


class Contacts:
    """Records pairs of vehicles whose boxes start to overlap, except configured collisions; moving ones stop there.

    Motion keeps bodies apart, so this records what it could not foresee: two who enter the simulation in each other.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._last_s: dict[tuple[str, str], float] = {}
        self._stands: dict[str, float] = {}  # until

    def step(self, stage: Stage) -> None:
        """Look at all boxes."""
        actors = stage.actors
        rows = np.flatnonzero(np.array([kind != "pedestrian" for kind in actors.kinds], bool))
        heading = actors.heading_rad[rows]
        forward = unit_vectors(heading)
        centre = actors.front[rows, :2] - forward * actors.size[rows, :1] / 2
        found = overlaps(centre, heading, actors.size[rows])
        for i, j in zip(rows[found.first].tolist(), rows[found.second].tolist(), strict=True):
            if abs(actors.speed_mps[i]) < abs(actors.speed_mps[j]):
                i, j = j, i
            self._meet(stage, i, j)
        for vehicle, until in list(self._stands.items()):
            if actors.time_s >= until:
                del self._stands[vehicle]
                stage.steered.discard(vehicle)
                if vehicle in stage.rows:
                    stage.api.vehicle.setSpeed(vehicle, -1)

    def _meet(self, stage: Stage, i: int, j: int) -> None:
        one, other = stage.actors.ids[i], stage.actors.ids[j]
        key, now = (min(one, other), max(one, other)), stage.actors.time_s
        last = self._last_s.get(key, -np.inf)
        self._last_s[key] = now
        if now - last < _FORGETS_S or key in stage.collided:
            return
        stage.record("contact", one, other)
        stands_s = stage.config.collision_stands_s.draw(self._rng)
        for row in (i, j):
            vehicle = stage.actors.ids[row]
            if not stage.actors.parked[row] and vehicle not in stage.busy:
                stage.api.vehicle.setSpeed(vehicle, 0.0)
                stage.steered.add(vehicle)
                self._stands[vehicle] = now + stands_s
