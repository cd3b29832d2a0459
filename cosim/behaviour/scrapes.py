"""Bodies that touch in turns which SUMO, whose vehicles bend with the road, thinks they can take."""

from __future__ import annotations

import numpy as np

from cosim.behaviour.stage import Stage
from cosim.motion import overlaps

_FORGETS_S = 10.0


class Scrapes:
    """Records every pair of vehicles whose boxes begin to overlap, collisions aside."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, str], float] = {}

    def step(self, stage: Stage) -> None:
        """Look at all boxes."""
        actors = stage.actors
        rows = np.flatnonzero(np.array([kind != "pedestrian" for kind in actors.kinds], bool))
        heading = actors.heading_rad[rows]
        forward = np.column_stack([np.cos(heading), np.sin(heading)])
        centre = actors.front[rows, :2] - forward * actors.size[rows, :1] / 2
        found = overlaps(centre, heading, actors.size[rows])
        for i, j in zip(rows[found.first].tolist(), rows[found.second].tolist(), strict=True):
            if actors.speed_mps[i] < actors.speed_mps[j]:
                i, j = j, i
            pair = (actors.ids[i], actors.ids[j])
            key = (min(pair), max(pair))
            if actors.time_s - self._last.get(key, -np.inf) > _FORGETS_S and key not in stage.collided:
                stage.record("scrape", *pair)
            self._last[key] = actors.time_s
