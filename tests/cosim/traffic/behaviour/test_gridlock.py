"""A main road without gaps, and drivers who wait at both sides of it: sooner or later one is let go first."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.behaviour.gridlock import Gridlock
from cosim.traffic.behaviour.roads import Roads
from cosim.traffic.behaviour.stage import Stage
from cosim.traffic.motion import Motion, overlaps
from cosim.traffic.simulation import Traffic
from tests.cosim.inspector import centres
from tests.cosim.traffic.behaviour.scenario import CAR, write_scenario

REACH_M = 220.0
PATIENT_S = 45.0  # minimum waiting time
CAREFUL = 31


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A crossroads of a main road, west to east, with a car every 1.5 s, and a side road with a car at either end."""
    folder = tmp_path_factory.mktemp("crossing")
    arms = {"w": (-REACH_M, 0), "e": (REACH_M, 0), "s": (0, -REACH_M), "n": (0, REACH_M)}
    nodes = ['<node id="c" x="0" y="0" type="priority"/>']
    nodes += [f'<node id="{name}" x="{x}" y="{y}"/>' for name, (x, y) in arms.items()]
    edges = []
    for name in arms:
        cut = f'numLanes="1" speed="13.89" priority="{9 if name in "we" else 1}"'
        edges += [
            f'<edge id="{name}c" from="{name}" to="c" {cut}/>',
            f'<edge id="c{name}" from="c" to="{name}" {cut}/>',
        ]
    routes = [
        f'<vType id="car" {CAR} impatience="off"/>',
        '<route id="main" edges="wc ce"/>',
        '<route id="north" edges="sc cn"/>',
        '<route id="south" edges="nc cs"/>',
        '<flow id="stream" type="car" route="main" begin="0" end="400" period="1.5" departSpeed="max"/>',
        '<vehicle id="southern" type="car" route="north" depart="25" departPos="150"/>',
        '<vehicle id="northern" type="car" route="south" depart="25" departPos="150"/>',
    ]
    return write_scenario(folder, nodes, edges, routes)


@dataclass
class Seen:
    """When side-road drivers stopped and when they crossed [s], who went first at once, how deep bodies overlapped."""

    stood: dict[str, float] = field(default_factory=dict)
    crossed: dict[str, float] = field(default_factory=dict)
    first_at_once: int = 0
    careful_again: set[str] = field(default_factory=set)
    deepest_m: float = 0.0


def watch(sumocfg: Path, seconds: float, gridlock: Gridlock | None) -> Seen:
    """Some minutes at the crossroads, with and without those who let others go."""
    seen = Seen()
    with Traffic(sumocfg, seed=1) as traffic:
        motion, roads, stage = Motion(traffic.step_s), Roads(traffic.api), None
        api = traffic.api.vehicle
        for _ in range(round(seconds / traffic.step_s)):
            actors = motion.update(traffic.step())
            if stage is None:
                stage = Stage(BehaviourConfig(preset="calm"), traffic, motion, roads, actors, {}, traffic.step_s)
                stage.rows = {name: row for row, name in enumerate(actors.ids)}
            stage.see(actors)
            if gridlock is not None:
                gridlock.step(stage)
            modes = {name: api.getSpeedMode(name) for name in ("southern", "northern") if name in stage.rows}
            seen.first_at_once = max(seen.first_at_once, sum(mode != CAREFUL for mode in modes.values()))
            for name in modes:
                row = stage.rows[name]
                if actors.speed_mps[row] < 0.1:
                    seen.stood.setdefault(name, actors.time_s)
                if actors.lanes[row] in ("cn_0", "cs_0"):
                    seen.crossed.setdefault(name, actors.time_s)
                    if modes[name] == CAREFUL:
                        seen.careful_again.add(name)
            found = overlaps(centres(actors), actors.heading_rad, actors.size)
            seen.deepest_m = max(seen.deepest_m, float(found.depth_m.max(initial=0.0)))
    return seen


def test_sumo_lets_them_wait_for_ever(crossing):
    seen = watch(crossing, 150.0, None)
    assert set(seen.stood) == {"southern", "northern"}
    assert not seen.crossed


def test_after_long_they_go_one_after_the_other_without_contact(crossing):
    seen = watch(crossing, 150.0, Gridlock())
    assert set(seen.stood) == set(seen.crossed) == {"southern", "northern"}
    for name, stood in seen.stood.items():
        assert PATIENT_S <= seen.crossed[name] - stood < PATIENT_S + 30.0
    assert abs(np.diff(list(seen.crossed.values()))[0]) > 3.0
    assert seen.first_at_once == 1
    assert seen.careful_again == {"southern", "northern"}
    assert seen.deepest_m == 0.0
