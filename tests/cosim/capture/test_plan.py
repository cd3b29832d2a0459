from dataclasses import replace

import numpy as np
import pytest

from cosim.capture.collection import Collection, FrameSelector
from cosim.capture.config import ConfigError, RunConfig, load_config
from cosim.capture.plan import plan_episodes, world_count
from cosim.capture.rig_jitter import RigJitter
from cosim.scene.site import light_of
from cosim.traffic.actors import Actors
from tests.cosim.road_users import road_users


def actors(time_s: float, ego_x: float, other_x: float | None = 20.0) -> Actors:
    xs = [ego_x] + ([] if other_x is None else [other_x])
    return road_users(["car"] * len(xs), [[x, 0, 0] for x in xs], ids=("ego", "other")[: len(xs)], time_s=time_s)


def test_frames_are_named_through_the_episodes_and_none_is_lost():
    plans = plan_episodes(RunConfig(frames=60, frames_per_episode=25))
    assert [len(plan.frames) for plan in plans] == [25, 25, 10]
    assert [name for plan in plans for name in plan.frames] == [f"{number:06d}" for number in range(60)]


def test_towns_take_turns_and_share_the_frames_evenly():
    plans = plan_episodes(RunConfig(town="all", frames=900, frames_per_episode=25))
    counts: dict[str, int] = {}
    for plan in plans:
        counts[plan.town] = counts.get(plan.town, 0) + len(plan.frames)
    assert len(counts) == 9 and set(counts.values()) == {100}


def test_few_frames_visit_every_town():
    plans = plan_episodes(RunConfig(town=("town01", "town02"), frames=10, frames_per_episode=25))
    assert [(plan.town, len(plan.frames)) for plan in plans] == [("town01", 5), ("town02", 5)]


def test_a_new_world_comes_after_so_many_episodes():
    plans = plan_episodes(RunConfig(frames=100, frames_per_episode=10, episodes_per_world=4))
    assert [plan.world for plan in plans] == [0, 0, 0, 0, 1, 1, 1, 1, 2, 2]
    assert world_count(plans) == 3


def test_four_episodes_of_a_town_share_a_world_and_towns_share_none():
    assert world_count(plan_episodes(RunConfig(frames=100, frames_per_episode=25))) == 1
    assert world_count(plan_episodes(RunConfig(frames=500, frames_per_episode=25))) == 5
    assert world_count(plan_episodes(RunConfig(town=("town01", "town02"), frames=200))) == 2


def test_every_episode_has_a_light_of_its_own_that_the_seed_repeats():
    lights = [light_of(RunConfig(seed=seed), episode) for seed in (1, 2) for episode in range(4)]
    assert len({light.sun_azimuth_deg for light in lights}) == 8
    assert light_of(RunConfig(seed=1), 0) == lights[0]


def test_a_standing_ego_gives_no_second_frame_and_in_the_end_a_jam():
    watch = FrameSelector(Collection(min_travel_m=2, patience_s=30), actors(0, 0.0), "ego")
    assert not watch.selects(actors(1, 1.0))
    assert watch.selects(actors(2, 3.0))
    assert not watch.selects(actors(3, 3.5))
    assert watch.end_reason(actors(30, 3.5)) is None
    assert watch.end_reason(actors(33, 3.5)).startswith("jam")


def test_empty_roads_are_passed_over_and_in_the_end_left():
    watch = FrameSelector(Collection(company_m=60, patience_s=30), actors(0, 0.0), "ego")
    assert not watch.selects(actors(1, 10.0, other_x=200.0))
    assert not watch.selects(actors(1, 10.0, other_x=None))
    assert watch.end_reason(actors(40, 300.0, other_x=900.0)).startswith("empty roads")
    assert watch.selects(actors(2, 10.0, other_x=40.0))


def test_company_is_who_is_ahead():
    watch = FrameSelector(Collection(company_m=60), actors(0, 0.0), "ego")
    assert not watch.selects(actors(1, 10.0, other_x=-20.0))
    assert watch.selects(actors(1, 10.0, other_x=30.0))


def test_an_ego_that_is_gone_ends_the_episode():
    watch = FrameSelector(Collection(), actors(0, 0.0), "ego")
    gone = replace(actors(1, 0.0), ids=("someone", "other"))
    assert watch.end_reason(gone) == "the ego vehicle left the road"


def test_the_rig_turns_as_widely_as_requested_and_only_on_request():
    rng = np.random.default_rng(0)
    assert (RigJitter().draw(rng) == np.eye(3)).all()
    jitter = RigJitter(enabled=True, mean_pitch_deg=0, roll_deg=1.5, pitch_deg=0.5, yaw_deg=4.0)
    turns = np.stack([jitter.draw(rng) for _ in range(4000)])
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.tile(np.eye(3), (4000, 1, 1)), atol=1e-12)
    pitch = np.degrees(-np.arcsin(turns[:, 2, 0]))
    roll = np.degrees(np.arctan2(turns[:, 2, 1], turns[:, 2, 2]))
    yaw = np.degrees(np.arctan2(turns[:, 1, 0], turns[:, 0, 0]))
    assert [pitch.std(), roll.std(), yaw.std()] == pytest.approx([0.5, 1.5, 4.0], rel=0.06)


def test_the_rig_has_the_pose_of_the_measured_one_by_default_and_as_the_published_code_has_it_on_request():
    rng = np.random.default_rng(0)
    nose_down = [-np.degrees(np.arcsin(RigJitter(enabled=True).draw(rng)[2, 0])) for _ in range(2000)]
    assert np.mean(nose_down) == pytest.approx(0.5, abs=0.05)
    reference = RigJitter.model_validate({"enabled": True, "preset": "reference", "yaw_deg": 1.0})
    assert (reference.mean_pitch_deg, reference.roll_deg, reference.pitch_deg, reference.yaw_deg) == (0, 1.5, 0.5, 1.0)


@pytest.mark.parametrize(
    "text",
    ["population: {driving: [50, 10]}", "environment: {vegetation: [-1, 1]}", "rig_jitter: {roll_deg: -2}"],
)
def test_impossible_distributions_are_refused_in_one_line(tmp_path, text):
    path = tmp_path / "run.yaml"
    path.write_text(text + "\n")
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert "\n" not in str(caught.value) and "run.yaml" in str(caught.value)
