"""Insertion of vehicles into a running simulation: never overlapping another one, never in view of the ego vehicle."""

from __future__ import annotations

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.motion import Motion, overlaps
from cosim.traffic.simulation import Traffic

_CLEAR_M = 0.15


class Admission:
    """Turns away vehicles that SUMO puts where a body is that follows late, or in sight of a watcher.

    Args:
        traffic: where vehicles enter.
        motion: where bodies are.
        watchers: vehicles in whose view no vehicle is inserted.
        sight_m: how far they see.
    """

    def __init__(self, traffic: Traffic, motion: Motion, watchers: set[str], sight_m: float) -> None:
        self._traffic = traffic
        self._motion = motion
        self._watchers = watchers
        self._sight_m = sight_m
        self._known: tuple[str, ...] = ()

    def admit(self, actors: Actors) -> Actors:
        """The actors of a step without those who are turned away; these leave the simulation."""
        if actors.ids == self._known:
            return actors
        before = set(self._known)
        wheeled = [row for row, kind in enumerate(actors.kinds) if kind != "pedestrian"]
        new = [row for row in wheeled if actors.ids[row] not in before and not actors.parked[row]]
        people = [row for row, kind in enumerate(actors.kinds) if kind == "pedestrian" and not actors.lanes[row]]
        away: set[str] = set()
        if new:
            touching = self._touching(actors, np.array([*wheeled, *people]), set(new))
            away = {actors.ids[row] for row in new if row in touching or (before and self._in_sight(actors, row))}
            for vehicle in sorted(away):
                self._traffic.remove(vehicle)
            actors = actors.without(away) if away else actors
        self._known = actors.ids
        return actors

    def _touching(self, actors: Actors, bodies: np.ndarray, new: set[int]) -> set[int]:
        front, heading = self._motion.poses(actors)
        centre = front - actors.to_front(heading)
        found = overlaps(centre[bodies], heading[bodies], actors.size[bodies, :2] + _CLEAR_M)
        pairs = zip(bodies[found.first].tolist(), bodies[found.second].tolist(), strict=True)
        return {j if j in new else i for i, j in pairs if i in new or j in new}

    def _in_sight(self, actors: Actors, row: int) -> bool:
        watchers = [i for i, name in enumerate(actors.ids) if name in self._watchers]
        away = actors.front[watchers, :2] - actors.front[row, :2]
        return bool((np.hypot(away[:, 0], away[:, 1]) < self._sight_m).any())
