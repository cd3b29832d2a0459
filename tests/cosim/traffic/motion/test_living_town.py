"""Towns for minutes: every step of every vehicle must be one that a real one could take."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour import BehaviourConfig, Event
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.ego import draw_ego
from cosim.traffic.simulation import Traffic
from sumo_nets import TOWNS, read_town
from tests.cosim.inspector import Inspector

BUSY = BehaviourConfig(u_turns_per_min=3, collisions_per_min=1.5, pull_outs_per_min=6, pull_ins_per_min=4)
OFF: dict[str, object] = {"u_turns_per_min": 0, "collisions_per_min": 0, "pull_outs_per_min": 0, "pull_ins_per_min": 0}
OFF["lane_change_share"] = {"kind": "constant", "value": 0}
QUICK = ("town08",)
DRAWN = {"u_turn", "collision", "pull_out", "pull_in", "lane_change"}


def live(
    steps: int, config: BehaviourConfig, seed: int = 1, town: str = "town01"
) -> tuple[Inspector, list[Event], int, Actors]:
    """A town's first minutes: what was seen, events, teleports, and the last step."""
    inspector, teleports, ego = Inspector(), 0, ""
    files = read_town(town)
    with Traffic(files.sumocfg, seed=seed) as traffic:
        living = DrivenTraffic(traffic, config, seed=seed, beside_parked=0.05)
        for number in range(steps):
            actors = living.step()
            teleports += traffic.api.simulation.getStartingTeleportNumber()
            if number > 5:
                inspector.look(actors, ego)
            if number == 600:
                ego = draw_ego(traffic, actors, np.random.default_rng(seed))
                living.protect(ego)
        return inspector, list(living.events), teleports, actors


def check(inspector: Inspector, events: list[Event], teleports: int) -> None:
    """What holds for any stretch: only the drawn collisions touch."""
    assert teleports == 0
    assert inspector.sideways_m < 0.3
    assert inspector.turn_deg < 6
    assert inspector.speed_error.max() < 0.05
    collided = {tuple(sorted(event.vehicles)) for event in events if event.kind == "collision"}
    assert {touch.vehicles for touch in inspector.touches} <= collided
    assert not inspector.surprises


def test_the_same_seed_gives_the_same_world():
    one, other = live(150, BUSY), live(150, BUSY)
    assert one[1] == other[1]
    for name in ("front", "heading_rad", "speed_mps", "body_pitch_rad"):
        assert np.array_equal(getattr(one[3], name), getattr(other[3], name))


@pytest.mark.parametrize("town", [t if t in QUICK else pytest.param(t, marks=pytest.mark.slow) for t in TOWNS])
def test_what_is_switched_off_never_happens(town):
    inspector, events, teleports, _ = live(450, BehaviourConfig.model_validate(OFF), town=town)
    check(inspector, events, teleports)
    assert not {event.kind for event in events} & {*DRAWN, "contact"}


def test_calm_drivers_never_touch():
    inspector, events, teleports, _ = live(450, BehaviourConfig(preset="calm"))
    check(inspector, events, teleports)
    assert not inspector.touches
    assert {event.kind for event in events} <= {"taken_away"}


@pytest.mark.slow
@pytest.mark.parametrize("town", TOWNS)
def test_a_busy_town_moves_like_a_real_one(town):
    inspector, events, teleports, _ = live(2400, BUSY, town=town)
    assert inspector.steps >= 120_000
    check(inspector, events, teleports)
    types = Counter(event.kind for event in events)
    assert not {kind for kind in DRAWN if not types[kind]}
    assert types["contact"] == 0
