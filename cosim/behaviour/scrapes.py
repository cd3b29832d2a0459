"""Bodies that touch where SUMO, whose vehicles bend with the road, thinks they pass."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim.behaviour.stage import Stage
from cosim.motion import overlaps

_FORGETS_S = 10.0
_DEEP_M, _LASTS_S = 0.05, 1.0
_STANDS_MPS = 0.3
_STUCK_S = 8.0


@dataclass(eq=False)
class _Touch:
    event: int | None  # in the stage's list; none where the pair has collided as drawn
    last_s: float
    deep_s: float | None = None  # since when
    stuck_s: float | None = None


class Scrapes:
    """Records every pair of vehicles whose boxes begin to overlap, collisions aside.

    A scrape that stays deep for a second is a collision. Of two that stand in each other, one is taken away.
    """

    def __init__(self) -> None:
        self._touches: dict[tuple[str, str], _Touch] = {}

    def step(self, stage: Stage) -> None:
        """Look at all boxes."""
        actors, step_s = stage.actors, stage.step_s
        rows = np.flatnonzero(np.array([kind != "pedestrian" for kind in actors.kinds], bool))
        heading = actors.heading_rad[rows]
        forward = np.column_stack([np.cos(heading), np.sin(heading)])
        centre = actors.front[rows, :2] - forward * actors.size[rows, :1] / 2
        found = overlaps(centre, heading, actors.size[rows])
        pairs = zip(rows[found.first].tolist(), rows[found.second].tolist(), found.depth_m.tolist(), strict=True)
        for i, j, depth in pairs:
            if abs(actors.speed_mps[i]) < abs(actors.speed_mps[j]):
                i, j = j, i
            touch = self._touch(stage, actors.ids[i], actors.ids[j])
            if actors.time_s - touch.last_s > 1.5 * step_s:
                touch.deep_s = touch.stuck_s = None
            touch.last_s = actors.time_s
            stands = bool(abs(actors.speed_mps[i]) < _STANDS_MPS)
            touch.deep_s = _since(touch.deep_s, depth > _DEEP_M, actors.time_s)
            touch.stuck_s = _since(touch.stuck_s, depth > _DEEP_M and stands, actors.time_s)
            self._judge(stage, touch, i, j)

    def _touch(self, stage: Stage, one: str, other: str) -> _Touch:
        key, now = (min(one, other), max(one, other)), stage.actors.time_s
        touch = self._touches.get(key)
        if touch is None or now - touch.last_s > _FORGETS_S:
            recorded = key not in stage.collided
            touch = self._touches[key] = _Touch(len(stage.events) if recorded else None, now)
            if recorded:
                stage.record("scrape", one, other)
        return touch

    def _judge(self, stage: Stage, touch: _Touch, i: int, j: int) -> None:
        now, actors = stage.actors.time_s, stage.actors
        if touch.event is None:
            return
        if touch.deep_s is not None and now - touch.deep_s > _LASTS_S:
            stage.events[touch.event] = replace(stage.events[touch.event], kind="collision")
        if touch.stuck_s is not None and now - touch.stuck_s > _STUCK_S:
            for row in (i, j):
                vehicle = actors.ids[row]
                if not actors.parked[row] and vehicle not in stage.busy and stage.take_away(vehicle):
                    return


def _since(before: float | None, holds: bool, now: float) -> float | None:
    """Since when something holds."""
    return (now if before is None else before) if holds else None
