"""Of a large network, the surroundings of the route are built, and nothing within sight is missing."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely

from assets.streets import StreetBuilding, StreetLane, Streets
from assets.world.build import build_world
from cosim.capture.config import load_config
from cosim.capture.episode import run_episode
from cosim.capture.plan import plan_episodes
from cosim.capture.recorder import Recorder
from cosim.capture.rig_sensors import rig_sensors
from cosim.capture.route_recorder import RouteRecorder
from cosim.drives.twin import read_glb
from cosim.drives.writer import DriveWriter
from cosim.scene import surroundings as module
from cosim.scene.surroundings import BUILT_M, is_large, lane_length_m, surroundings
from tests.cosim.hamlet import write_hamlet

STEP_M, COUNT = 500.0, 12
SIGHT_M = 300.0
ROUTE = np.column_stack([np.linspace(2100.0, 2600.0, 9), np.full(9, 2000.0)])


def lane(name: str, *points: tuple[float, float, float]) -> StreetLane:
    return StreetLane(f"{name}_0", name, "drive", np.array(points, float), 3.2, 13.9, False)


@pytest.fixture(scope="module")
def grid() -> Streets:
    """Streets that cross the whole town in one piece, which rises to the east."""
    end_m = STEP_M * (COUNT - 1)
    east = [lane(f"e{k}", (0, k * STEP_M, 0), (end_m, k * STEP_M, 55)) for k in range(COUNT)]
    north = [lane(f"n{k}", (k * STEP_M, 0, 5 * k), (k * STEP_M, end_m, 5 * k)) for k in range(COUNT)]
    return Streets("grid", (*east, *north), (), (), ())


def test_what_is_in_sight_is_built_and_little_more(grid):
    assert is_large(grid)
    near = surroundings(grid, ROUTE, SIGHT_M)
    seen = shapely.buffer(shapely.LineString(ROUTE), SIGHT_M)
    whole, part = ([shapely.LineString(each.centre[:, :2]) for each in net.lanes] for net in (grid, near))
    in_sight = shapely.intersection(shapely.union_all(whole), seen)
    assert shapely.length(shapely.difference(in_sight, shapely.buffer(shapely.union_all(part), 0.01))) < 0.01
    assert np.ptp(np.concatenate([each.centre[:, :2] for each in near.lanes]), axis=0).max() < 500 + 2 * BUILT_M
    assert lane_length_m(near) < 0.1 * lane_length_m(grid)


def test_cut_lanes_keep_their_heights(grid):
    for each in surroundings(grid, ROUTE, SIGHT_M).lanes:
        np.testing.assert_allclose(each.centre[:, 2], each.centre[:, 0] / 100, atol=1e-9)


def test_a_part_without_buildings_of_a_town_with_buildings_has_no_random_ones(grid):
    house = StreetBuilding("far", np.array([[20.0, 20.0], [40.0, 20.0], [40.0, 40.0]]), 6.0)
    given = surroundings(replace(grid, buildings=(house,)), ROUTE, 60.0)
    assert not given.buildings and given.defines_buildings
    heights = [build_world(net, 1).mesh.vertices[:, 2] for net in (given, surroundings(grid, ROUTE, 60.0))]
    assert len(heights[0]) < 0.8 * len(heights[1])


def test_no_street_in_sight_is_an_error(grid):
    with pytest.raises(ValueError, match="no lane lies within"):
        surroundings(grid, np.array([[-9000.0, 0.0]]), SIGHT_M)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory, monkeypatch_module):
    """Record an episode in the whole town, along its route, and along its route after an interruption."""
    folder = tmp_path_factory.mktemp("route")
    config = load_config(write_hamlet(folder), frames=4, frames_per_episode=4, images=())
    plan = plan_episodes(config)[0]
    for name, done in (("whole", ()), ("route", ()), ("resumed", plan.frames[:2])):
        monkeypatch_module.setattr(module, "LARGE_M", np.inf if name == "whole" else 0.0)
        recorder = Recorder(config, rig_sensors(config), DriveWriter(folder / name))
        town = recorder.move_to(plan)
        assert recorder.follows_route == (name != "whole")
        target = RouteRecorder(recorder, plan, done, lambda _: None) if recorder.follows_route else recorder
        run_episode(plan, config, town, target, done=(), on_frame=lambda _: None)
        recorder.close()
    return folder, plan


@pytest.fixture(scope="module")
def monkeypatch_module():
    with pytest.MonkeyPatch.context() as patch:
        yield patch


def test_traffic_is_the_same_whether_a_town_is_built_as_a_whole_or_along_the_route(recordings):
    folder, plan = recordings
    for name in plan.frames:
        whole, route = (
            json.loads((folder / kind / f"twin/frames/{name}.json").read_text()) for kind in ("whole", "route")
        )
        assert whole["time_s"] == route["time_s"]
        assert [each["id"] for each in whole["instances"]] == [each["id"] for each in route["instances"]]
        for a, b in zip((whole["ego"], *whole["instances"]), (route["ego"], *route["instances"]), strict=True):
            np.testing.assert_allclose(np.array(a["pose"])[:2, 3], np.array(b["pose"])[:2, 3], atol=1e-6)


def test_an_interrupted_episode_is_recorded_in_the_same_world(recordings):
    folder, plan = recordings
    whole, rest = (read_glb(folder / kind / "twin/static.glb") for kind in ("route", "resumed"))
    assert np.array_equal(whole.vertices, rest.vertices)
    for name in plan.frames[2:]:
        scans = [(folder / kind / f"velodyne/{name}.bin").read_bytes() for kind in ("route", "resumed")]
        assert scans[0] == scans[1]
    assert not (folder / "resumed/velodyne" / f"{plan.frames[0]}.bin").exists()
