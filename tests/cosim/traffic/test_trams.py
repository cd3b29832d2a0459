"""Trams of a user's scenario: where their tracks are, how they move, and what they never do."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.ego import draw_ego
from cosim.traffic.simulation import Traffic
from sumo_nets import read_town
from tests.cosim.traffic.behaviour.scenario import CAR, write_scenario

LENGTH_M, BOGIE_M = 15.0, 3.4  # from either end to its bogie
NODES = [
    '<node id="A" x="0" y="0"/><node id="B" x="60" y="0"/><node id="C" x="118" y="120"/>',
    '<node id="D" x="60" y="-60"/><node id="E" x="160" y="-60"/>',
]
TURN = np.linspace(-np.pi / 2, 0, 16)  # a quarter of a circle of 18 m
BEND = " ".join(f"{100 + 18 * x:.2f},{18 + 18 * y:.2f}" for x, y in zip(np.cos(TURN), np.sin(TURN), strict=True))
ALLOWS = "passenger truck bus bicycle"
EDGES = [
    f'<edge id="in" from="A" to="B" numLanes="2" speed="13.9"><lane index="0" allow="{ALLOWS}"/>'
    f'<lane index="1" allow="{ALLOWS} tram"/></edge>',
    f'<edge id="out" from="B" to="C" numLanes="2" speed="13.9" shape="60,0 {BEND} 118,120">'
    f'<lane index="0" allow="{ALLOWS}"/><lane index="1" allow="{ALLOWS} tram"/></edge>',
    '<edge id="own" from="D" to="E" numLanes="1" speed="13.9" allow="tram rail_urban"/>',
    '<edge id="back" from="E" to="D" numLanes="1" speed="13.9" allow="rail"/>',
]
ROUTES = [
    f'<vType id="car" {CAR}/><vType id="tram" vClass="tram" length="{LENGTH_M}" width="2.4" height="3.4"/>'
    '<vType id="metro" vClass="rail_urban" length="15" width="2.6" height="3.5"/>',
    '<vehicle id="tram" type="tram" depart="0" departPos="20" departLane="1"><route edges="in out"/></vehicle>'
    '<vehicle id="metro" type="metro" depart="0" departPos="20"><route edges="own"/></vehicle>'
    '<vehicle id="car" type="car" depart="1" departLane="0"><route edges="in out"/></vehicle>',
]


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    return write_scenario(tmp_path_factory.mktemp("trams"), NODES, EDGES, ROUTES)


def test_lanes_for_trams_have_tracks_and_railways_are_left_out_with_a_note(scenario):
    town = read_town(scenario)
    lanes = {lane.id: lane for lane in town.streets.lanes}
    tracked = {name for name, lane in lanes.items() if lane.tracks and not lane.internal}
    assert tracked == {"in_1", "out_1", "own_0"}
    assert (lanes["in_1"].use, lanes["own_0"].use) == ("drive", "tram")
    assert any(lane.tracks and lane.internal for lane in lanes.values())
    assert "back_0" not in lanes and any("1 edges of rail" in note for note in town.notes)


def test_a_network_without_restrictions_has_no_tracks(tmp_path):
    edges = ['<edge id="in" from="A" to="B" numLanes="1" speed="13.9"/>']
    town = read_town(write_scenario(tmp_path, NODES, edges, ROUTES[:1]))
    assert not any(lane.tracks for lane in town.streets.lanes)


@pytest.mark.parametrize("behaviour", ["sumo", "paper"])
def test_both_bogies_of_a_tram_stay_on_its_track_round_a_corner(scenario, behaviour):
    town, settings = read_town(scenario), BehaviourConfig.model_validate(behaviour)
    track = shapely.union_all([shapely.LineString(lane.centre[:, :2]) for lane in town.streets.lanes if lane.tracks])
    places, speeds = [], []
    with Traffic(scenario, seed=1, as_given=settings.as_given) as traffic:
        living = DrivenTraffic(traffic, settings, seed=1)
        for _ in range(220):
            actors = living.step()
            for row in [row for row, name in enumerate(actors.ids) if name == "tram"]:
                heading = actors.heading_rad[row]
                ahead = np.array([np.cos(heading), np.sin(heading)])
                bogies = [actors.front[row, :2] - at * ahead for at in (BOGIE_M, LENGTH_M - BOGIE_M)]
                if actors.time_s > 1 and actors.front[row, 1] < 100:
                    places += bogies
                    speeds.append(actors.speed_mps[row])
    assert len(speeds) > 60 and max(speeds) > 5
    assert shapely.distance(track, shapely.points(np.array(places))).max() < 0.25
    assert np.ptp(np.array(places)[:, 1]) > 30  # round the corner


def test_sensors_are_never_on_a_tram(scenario):
    with Traffic(scenario, seed=1) as traffic:
        living = DrivenTraffic(traffic, BehaviourConfig(), seed=1)
        actors = living.advance(40)
        assert sorted(zip(actors.ids, actors.kinds, strict=True)) == [
            ("car", "car"),
            ("metro", "tram"),
            ("tram", "tram"),
        ]
        assert {draw_ego(traffic, actors, np.random.default_rng(seed)) for seed in range(10)} == {"car"}
        living.follow("car")
        assert {name for event in living.events for name in event.vehicles}.isdisjoint({"tram", "metro"})
