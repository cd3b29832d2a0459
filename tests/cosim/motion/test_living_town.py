"""A town for minutes: every step of every vehicle must be one that a real one could take."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from cosim.actors import Actors
from cosim.behaviour import BehaviourConfig, Event
from cosim.living import LivingTraffic
from cosim.motion import overlaps
from cosim.traffic import Traffic
from sumo_nets import read_town

STEP_S = 0.1
BUSY = BehaviourConfig(u_turns_per_min=3, collisions_per_min=1.5, pull_outs_per_min=6, pull_ins_per_min=4)


def centres(actors: Actors) -> np.ndarray:
    """Middles of the boxes (n, 2)."""
    walks = np.array([kind == "pedestrian" for kind in actors.kinds])
    forward = np.column_stack([np.cos(actors.heading_rad), np.sin(actors.heading_rad)])
    return actors.front[:, :2] - np.where(walks, 0, actors.size[:, 0] / 2)[:, None] * forward


class Inspector:
    """Looks at all steps and keeps the worst of each kind."""

    def __init__(self) -> None:
        self.steps = 0
        self.sideways_m = self.turn_deg = self.speed_error = 0.0
        self.touching: set[tuple[str, str]] = set()
        self._before: tuple[dict[str, int], np.ndarray, np.ndarray] | None = None

    def look(self, actors: Actors) -> None:
        """Compare a step with the last."""
        drives = np.array([kind != "pedestrian" for kind in actors.kinds])
        centre, rows = centres(actors), {name: row for row, name in enumerate(actors.ids)}
        if self._before is not None:
            known, centre_0, heading_0 = self._before
            now = np.array([row for name, row in rows.items() if drives[row] and name in known])
            was = np.array([known[name] for name, row in rows.items() if drives[row] and name in known])
            moved = centre[now] - centre_0[was]
            turn = (actors.heading_rad[now] - heading_0[was] + np.pi) % (2 * np.pi) - np.pi
            middle = heading_0[was] + turn / 2
            sideways = np.abs(moved[:, 1] * np.cos(middle) - moved[:, 0] * np.sin(middle))
            speed = np.hypot(*moved.T) / STEP_S
            reported = np.hypot(actors.speed_mps, actors.lateral_mps)[now]
            goes = speed > 0.5
            self.steps += int((~actors.parked[now]).sum())
            self.sideways_m = max(self.sideways_m, sideways.max())
            self.turn_deg = max(self.turn_deg, np.degrees(np.abs(turn)).max())
            if goes.any():
                self.speed_error = max(self.speed_error, (np.abs(reported - speed)[goes] / speed[goes]).max())
        wheels = np.flatnonzero(drives)
        found = overlaps(centre[wheels], actors.heading_rad[wheels], actors.size[wheels])
        for i, j in zip(wheels[found.first], wheels[found.second], strict=True):
            one, other = actors.ids[i], actors.ids[j]
            self.touching.add((min(one, other), max(one, other)))
        self._before = rows, centre, actors.heading_rad


def live(steps: int, config: BehaviourConfig, seed: int = 1) -> tuple[Inspector, list[Event], int, Actors]:
    """A town's first minutes: what was seen, events, teleports, and the last step."""
    inspector, teleports = Inspector(), 0
    with Traffic(read_town("town01").sumocfg, seed=seed) as traffic:
        living = LivingTraffic(traffic, config, seed=seed)
        for number in range(steps):
            actors = living.step()
            teleports += traffic.api.simulation.getStartingTeleportNumber()
            if number > 5:
                inspector.look(actors)
        return inspector, list(living.events), teleports, actors


def check(inspector: Inspector, events: list[Event], teleports: int) -> None:
    """What holds for any stretch."""
    assert teleports == 0
    assert inspector.sideways_m < 0.3
    assert inspector.turn_deg < 6
    assert inspector.speed_error < 0.05
    recorded = {(min(e.vehicles), max(e.vehicles)) for e in events if e.kind in ("collision", "scrape")}
    assert inspector.touching <= recorded


def test_the_same_seed_gives_the_same_world():
    one, other = live(250, BUSY), live(250, BUSY)
    assert one[1] == other[1]
    for name in ("front", "heading_rad", "speed_mps", "body_pitch_rad"):
        assert np.array_equal(getattr(one[3], name), getattr(other[3], name))


def test_what_is_switched_off_never_happens():
    inspector, events, teleports, _ = live(450, BehaviourConfig(preset="calm"))
    check(inspector, events, teleports)
    # bodies may still touch in turns; nothing that is drawn happens
    assert {event.kind for event in events} <= {"scrape", "collision", "taken_away"}


@pytest.mark.slow
def test_a_busy_town_moves_like_a_real_one():
    inspector, events, teleports, _ = live(2400, BUSY)
    assert inspector.steps >= 120_000
    check(inspector, events, teleports)
    kinds = Counter(event.kind for event in events)
    assert all(kinds[kind] > 0 for kind in ("u_turn", "pull_out", "pull_in", "collision", "lane_change"))
