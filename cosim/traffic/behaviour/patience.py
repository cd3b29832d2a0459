"""SUMO's vehicles wait for bodies that cannot go where they go."""

from __future__ import annotations

import numpy as np

from cosim.traffic.behaviour.stage import Stage

_LATE_M, _BACK_M = 2.0, 1.0
_WAITS_S = 0.25
_ASTRAY_M, _ASTRAY_S = 2.0, 30.0
_LOST_M = 20.0
_STUCK_S, _GOES_FIRST_S = 3.0, 6.0
_BACKS_UP_S, _BACKS_UP_AGAIN_S = 4.0, 12.0
_BACK_WAY_M, _RESTS_S, _ASIDE_M = 4.0, 3.0, 0.4
_STANDS_MPS = 0.1
_CAREFUL, _GOES_FIRST = 31, 55  # SUMO's speed modes: all checks; right of way is ignored


class Patience:
    """Slows SUMO's vehicle while its body waits or is left behind, and takes bodies away that will not come back.

    A body can catch up only if SUMO's position is ahead of it; if the position is next to it, SUMO must continue.
    """

    def __init__(self) -> None:
        self._slowed: set[str] = set()
        self._astray: dict[str, float] = {}
        self._go_first: dict[str, float] = {}  # until
        self._backed_s: dict[str, float] = {}

    def step(self, stage: Stage) -> None:
        """Compare bodies with SUMO's places."""
        motion, actors, api = stage.motion, stage.actors, stage.api.vehicle
        lag, behind, waits = motion.lag(), motion.behind(), motion.waits_s() > _WAITS_S
        slow = (waits | (behind > _LATE_M)) & ~actors.parked
        for row in np.flatnonzero(slow).tolist():
            vehicle = actors.ids[row]
            if vehicle not in stage.steered and actors.lanes[row]:
                rolls = 0.0 if behind[row] > _LATE_M else max(float(actors.speed_mps[row]), 0.0)
                api.setSpeed(vehicle, rolls)
                self._slowed.add(vehicle)
        for vehicle in sorted(self._slowed):
            row = stage.rows.get(vehicle)
            if row is None or vehicle in stage.steered:
                self._slowed.discard(vehicle)
            elif not waits[row] and behind[row] < _BACK_M:
                self._slowed.discard(vehicle)
                api.setSpeed(vehicle, stage.pace.get(vehicle, -1.0))
        self._untie(stage)
        self._back_up(stage)
        self._give_up(stage, lag)

    def _back_up(self, stage: Stage) -> None:
        """Move a blocked vehicle back, let the other one pass, and try again with more distance to the obstacle."""
        motion, actors = stage.motion, stage.actors
        for row in np.flatnonzero(motion.stuck_s() > _BACKS_UP_S).tolist():
            vehicle = actors.ids[row]
            other = motion.blocker(vehicle)
            at = stage.rows.get(other) if other is not None else None
            recently = actors.time_s - self._backed_s.get(vehicle, -np.inf) < _BACKS_UP_AGAIN_S
            if at is None or other is None or recently or vehicle in stage.steered or motion.plays(other):
                continue
            if abs(actors.speed_mps[at]) > _STANDS_MPS or actors.kinds[row] == "tram":
                continue
            heading = actors.heading_rad[row]
            away = actors.front[at, :2] - actors.front[row, :2]
            left = away[1] * np.cos(heading) - away[0] * np.sin(heading) > 0
            self._backed_s[vehicle] = actors.time_s
            motion.back_up(vehicle, _BACK_WAY_M, _RESTS_S, -_ASIDE_M if left else _ASIDE_M)

    def _untie(self, stage: Stage) -> None:
        """Give right of way to waiting vehicles that block others; bodies still keep apart."""
        motion, actors, api = stage.motion, stage.actors, stage.api.vehicle
        for row in np.flatnonzero(motion.stuck_s() > _STUCK_S).tolist():
            other = motion.blocker(actors.ids[row])
            at = stage.rows.get(other) if other is not None else None
            if other is None or at is None or actors.parked[at] or other in stage.steered or other in self._go_first:
                continue
            if abs(actors.speed_mps[at]) < _STANDS_MPS and actors.kinds[at] != "pedestrian":
                api.setSpeedMode(other, _GOES_FIRST)
                self._go_first[other] = actors.time_s + _GOES_FIRST_S
        for vehicle, until in list(self._go_first.items()):
            if actors.time_s >= until or vehicle not in stage.rows:
                del self._go_first[vehicle]
                if vehicle in stage.rows and vehicle not in stage.steered:
                    api.setSpeedMode(vehicle, _CAREFUL)

    def _give_up(self, stage: Stage, lag: np.ndarray) -> None:
        now, before = stage.actors.time_s, self._astray
        self._astray = {}
        stuck = (stage.motion.stuck_s() > _STUCK_S) & (stage.motion.waits_s() > 0)
        for row in np.flatnonzero(((lag > _ASTRAY_M) | stuck) & ~stage.actors.parked).tolist():
            vehicle = stage.actors.ids[row]
            if vehicle in stage.busy:
                continue
            since = self._astray[vehicle] = before.get(vehicle, now)
            if lag[row] > _LOST_M or now - since > _ASTRAY_S:
                stage.take_away(vehicle)
