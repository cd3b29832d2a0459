"""Vehicles near the ego vehicle move as bodies; others are at SUMO's positions, at little cost."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.ego import draw_ego
from cosim.traffic.simulation import Traffic
from cosim.traffic.warm_up import WarmUp
from sumo_nets import read_town
from tests.cosim.inspector import Inspector

BUSY = BehaviourConfig(u_turns_per_min=3, collisions_per_min=1.5, pull_outs_per_min=6, pull_ins_per_min=4)
SIGHT_M = 120.0


@dataclass
class Ride:
    """A minute behind an ego vehicle: what was near, and everyone at some instants."""

    inspector: Inspector
    near: list[Actors]
    everyone: list[Actors]
    ego: str
    there: list[set[str]]


def ride(folder: Path, steps: int = 400, town: str = "town02") -> Ride:
    sumocfg = read_town(town).sumocfg
    state = WarmUp(sumocfg, 1, 60.0, folder).state()
    with Traffic(sumocfg, 1, state=state) as traffic:
        living = DrivenTraffic(traffic, BUSY, seed=1, sight_m=SIGHT_M)
        actors = living.step()
        ego = draw_ego(traffic, actors, np.random.default_rng(1))
        living.follow(ego)
        seen = Ride(Inspector(), [], [], ego, [])
        for number in range(steps):
            traffic.prolong_route(ego, np.random.default_rng(number))
            actors = living.step()
            seen.inspector.look(actors, ego)
            if number % 50 == 49:
                seen.near.append(actors)
                seen.everyone.append(living.everyone(actors))
                api = traffic.api
                seen.there.append({*api.vehicle.getIDList(), *api.person.getIDList()})
        return seen


@pytest.fixture(scope="module")
def seen(tmp_path_factory) -> Ride:
    return ride(tmp_path_factory.mktemp("ride"))


def away_m(actors: Actors, ego: str) -> np.ndarray:
    return np.hypot(*(actors.front[:, :2] - actors.front[actors.ids.index(ego), :2]).T)


def test_most_of_a_town_is_left_to_sumo(seen):
    for near, everyone in zip(seen.near, seen.everyone, strict=True):
        assert 2 * len(near) < len(everyone)


def test_no_vehicle_is_missing_or_duplicated(seen):
    for everyone, there in zip(seen.everyone, seen.there, strict=True):
        assert len(set(everyone.ids)) == len(everyone.ids)
        assert {name for name in there if not name.startswith("keeper")} == set(everyone.ids)


def test_all_within_sight_are_near(seen):
    for near, everyone in zip(seen.near, seen.everyone, strict=True):
        within = away_m(everyone, seen.ego) < SIGHT_M
        assert {everyone.ids[row] for row in np.flatnonzero(within)} <= set(near.ids)


def test_they_move_as_bodies_do(seen):
    assert seen.inspector.steps > 4000
    assert seen.inspector.sideways_m < 0.3
    assert seen.inspector.turn_deg < 6
    assert seen.inspector.speed_error.max() < 0.05
    assert not seen.inspector.surprises


def test_parked_vehicles_have_equal_poses_near_and_far(seen):
    stood: dict[str, np.ndarray] = {}
    for everyone in seen.everyone:
        for row in np.flatnonzero(everyone.parked):
            pose = np.array([*everyone.front[row], everyone.heading_rad[row]])
            assert np.allclose(stood.setdefault(everyone.ids[row], pose), pose, atol=1e-9)
    assert len(stood) > 50


def test_the_same_seed_gives_the_same_ride(tmp_path):
    one, other = (ride(tmp_path, 100) for _ in range(2))
    for a, b in zip(one.everyone, other.everyone, strict=True):
        assert a.ids == b.ids and np.array_equal(a.front, b.front) and np.array_equal(a.heading_rad, b.heading_rad)
