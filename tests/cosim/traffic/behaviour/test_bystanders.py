"""People near parked cars: their positions, and the distance of traffic."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pytest

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.motion import overlaps
from cosim.traffic.simulation import Traffic
from sumo_nets import DemandConfig, read_town
from tests.cosim.inspector import centres

STEPS = 250


@dataclass
class Seen:
    """What happened in a town's first 25 seconds with people about every fifth parked car."""

    people: list[Actors] = field(default_factory=list)
    parked: set[str] = field(default_factory=set)
    sides: Counter[str] = field(default_factory=Counter)
    run_over: set[tuple[str, str]] = field(default_factory=set)
    drove_off: set[str] = field(default_factory=set)
    fastest_mps: float = 0.0


def watch(steps: int = STEPS, share: float = 0.2) -> Seen:
    seen, busy = Seen(), BehaviourConfig(u_turns_per_min=3, pull_outs_per_min=12, pull_ins_per_min=6)
    with Traffic(read_town("town08").sumocfg, seed=1) as traffic:
        living = DrivenTraffic(traffic, busy, seed=1, beside_parked=share)
        for number in range(steps):
            actors = living.step()
            if number < 10:
                continue
            where, rows = centres(actors), {name: row for row, name in enumerate(actors.ids)}
            about = [row for row, name in enumerate(actors.ids) if name.startswith("by_")]
            seen.people.append(actors.take(np.array(about, int)))
            seen.parked.update(actors.ids[row] for row in np.flatnonzero(actors.parked))
            wheeled = np.array([kind != "pedestrian" for kind in actors.kinds], bool)
            moves = (np.abs(actors.speed_mps) > 0.1) & ~actors.parked & wheeled
            seen.fastest_mps = max(seen.fastest_mps, *actors.speed_mps[about].tolist(), 0.0)
            found = overlaps(where, actors.heading_rad, actors.size)
            for i, j in zip(found.first.tolist(), found.second.tolist(), strict=True):
                if (i in about and moves[j]) or (j in about and moves[i]):
                    seen.run_over.add((actors.ids[i], actors.ids[j]))
            for row in about:
                car = rows.get(actors.ids[row].removeprefix("by_"))
                if car is None or not actors.parked[car]:
                    seen.drove_off.add(actors.ids[row])
                    continue
                heading = actors.heading_rad[car]
                away = where[row] - where[car]
                left = away[1] * np.cos(heading) - away[0] * np.sin(heading)
                half = actors.size[car, 1] / 2
                seen.sides["street" if left > half else "kerb" if left < -half else "end"] += 1
    return seen


@pytest.fixture(scope="module")
def seen() -> Seen:
    return watch()


def test_the_requested_number_of_parked_cars_have_people_near_them(seen):
    assert 0.05 * len(seen.parked) < len(seen.people[-1]) < 0.25 * len(seen.parked)
    assert set(seen.people[-1].kinds) == {"pedestrian"}


def test_they_are_at_the_streets_side_behind_and_at_the_kerbs(seen):
    total = seen.sides.total()
    assert seen.sides["street"] > 0.1 * total
    assert seen.sides["end"] > 0.1 * total
    assert seen.sides["kerb"] > 0.1 * total


def test_no_person_is_hit_and_no_car_leaves_with_a_person_near_it(seen):
    assert not seen.run_over
    assert not seen.drove_off


def test_they_walk_and_do_not_jump(seen):
    for before, after in zip(seen.people, seen.people[1:], strict=False):
        rows = {name: row for row, name in enumerate(before.ids)}
        both = [(rows[name], row) for row, name in enumerate(after.ids) if name in rows]
        way = [np.hypot(*(after.front[row, :2] - before.front[known, :2])) for known, row in both]
        assert max(way, default=0.0) < 0.3
    assert 0.3 < seen.fastest_mps < 3.1


def test_the_same_seed_gives_the_same_people():
    one, other = watch(25), watch(25)
    assert one.people[-1].ids == other.people[-1].ids
    assert np.array_equal(one.people[-1].front, other.people[-1].front)


def test_none_where_none_are_requested():
    assert not len(watch(20, share=0.0).people[-1])


def test_a_share_above_one_is_refused():
    with pytest.raises(ValueError, match=r"a share of 1\.2 is above 1"):
        DemandConfig(beside_parked=(0.5, 1.2))
