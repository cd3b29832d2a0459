"""Parallel roads, each with a moving and a stopped vehicle: the configured behaviour is driven."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.simulation import Traffic
from tests.cosim.traffic.behaviour.scenario import CAR, write_scenario

ROADS = 90
LIMIT_MPS = 13.89
LENGTH_M, STOP_M = 500.0, 450.0


@pytest.fixture(scope="module")
def roads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Straight roads, 20 m apart."""
    folder = tmp_path_factory.mktemp("roads")
    nodes, edges, cars = [], [], []
    for i in range(ROADS):
        nodes += [f'<node id="a{i}" x="0" y="{20 * i}"/>', f'<node id="b{i}" x="{LENGTH_M}" y="{20 * i}"/>']
        edges += [f'<edge id="r{i}" from="a{i}" to="b{i}" numLanes="1" speed="{LIMIT_MPS}"/>']
        stop = f'<stop lane="r{i}_0" endPos="{STOP_M}" duration="100000"/>'
        route = f'<route edges="r{i}"/>'
        cars += [
            f'<vehicle id="stopped{i}" type="car" depart="0" departPos="stop" departSpeed="0">{route}{stop}</vehicle>',
            f'<vehicle id="drives{i}" type="car" depart="0" departPos="10" departSpeed="0">{route}</vehicle>',
        ]
    return write_scenario(folder, nodes, edges, [f'<vType id="car" {CAR} speedFactor="1"/>', *cars])


def observe(sumocfg: Path, config: BehaviourConfig) -> tuple[np.ndarray, ...]:
    """Excess over the limit [km/h], standstill gap [m] and lateral offset from the lane's centre [m] of each driver."""
    fastest: dict[str, float] = {}
    aside: dict[str, float] = {}
    with Traffic(sumocfg, seed=3) as traffic:
        middle = {name: 20 * i - 1.6 for i, name in enumerate(f"r{i}_0" for i in range(ROADS))}
        living = DrivenTraffic(traffic, config, seed=5)
        for _ in range(600):
            actors = living.step()
            for row, name in enumerate(actors.ids):
                fastest[name] = max(fastest.get(name, 0.0), actors.speed_mps[row])
                if 250 < actors.front[row, 0] < 270:
                    aside[name] = actors.front[row, 1] - middle[actors.lanes[row]]
        gap = [STOP_M - 4.3 - actors.front[row, 0] for row, name in enumerate(actors.ids) if name.startswith("drives")]
    excess = [(fastest[f"drives{i}"] - LIMIT_MPS) * 3.6 for i in range(ROADS)]
    return np.array(excess), np.array(gap), np.array(list(aside.values()))


def test_speeding_gap_and_offset_follow_the_configured_distributions(roads):
    excess, gap, aside = observe(roads, BehaviourConfig(collisions_per_min=0, u_turns_per_min=0))
    assert stats.kstest(excess, stats.uniform(0, 30).cdf).pvalue > 0.01
    assert stats.kstest(gap, stats.uniform(0.2, 2.8).cdf).pvalue > 0.01
    assert stats.kstest(aside - np.median(aside) + 0.0, stats.uniform(-0.2, 0.4).cdf).pvalue > 0.01
    assert gap.min() > 0


def test_calm_drivers_keep_limits_and_lanes(roads):
    excess, gap, aside = observe(roads, BehaviourConfig(preset="calm"))
    assert excess.max() < 1.0 and np.ptp(aside) < 0.02 and gap.min() > 1.4
