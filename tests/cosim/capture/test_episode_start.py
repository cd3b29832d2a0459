"""Starts of episodes: prepared ahead they are the same; wrong guesses do not matter."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.capture.config import RunConfig
from cosim.capture.episode_start import EpisodeStart, EpisodeStarts
from cosim.capture.plan import plan_episodes
from cosim.traffic.starting import TrafficError
from cosim.traffic.warm_up import WarmUp
from sumo_nets import read_town
from sumo_nets.tools import strip_comments

CONFIG = RunConfig(town="town02", seed=5, frames=12, frames_per_episode=2, warm_up_s=20.0)
PLANS = plan_episodes(CONFIG)
TOWN = read_town("town02")


def saved(start: EpisodeStart) -> tuple[str, float, int, int]:
    """Saved state without date and paths, its time, SUMO's seed and the next random number."""
    state = start.state()
    assert state is not None
    strip_comments(state.path)
    text = state.path.read_text().replace(start.folder.name, "")
    return text, state.time_s, start.seed, int(start.rng.integers(2**31))


@pytest.fixture
def starts():
    made = EpisodeStarts(CONFIG)
    yield made
    made.close()


def folders(starts: EpisodeStarts) -> list[Path]:
    return [Path(start.folder.name) for start in starts._ahead.values()]


def test_a_prepared_start_is_that_of_the_episode(starts):
    starts.prepare(PLANS[0])
    starts.prepare(PLANS[1])
    for plan in PLANS[:2]:
        with starts.take(plan, 0, CONFIG, TOWN) as ahead, EpisodeStart.of(plan, 0, CONFIG, TOWN) as fresh:
            assert saved(ahead) == saved(fresh)
            assert saved(ahead)[1] == pytest.approx(12.0) and ahead.lead_in_s == pytest.approx(8.0)
        assert not Path(ahead.folder.name).exists()


def test_the_next_simulation_of_an_episode_differs(starts):
    starts.prepare(PLANS[0])
    with starts.take(PLANS[0], 0, CONFIG, TOWN) as first, starts.take(PLANS[0], 1, CONFIG, TOWN) as second:
        assert saved(first)[0] != saved(second)[0]


def test_episodes_that_another_process_records_are_dropped(starts):
    for plan in PLANS[:4]:
        starts.prepare(plan)
        assert len(folders(starts)) <= 2
    assert list(starts._ahead) == [2, 3]
    kept = folders(starts)
    starts.close()
    assert not any(folder.exists() for folder in kept)


def test_a_scenario_that_sumo_refuses(tmp_path):
    scenario = tmp_path / "x.sumocfg"
    scenario.write_text('<configuration><input><net-file value="missing.net.xml"/></input></configuration>')
    warm_up = WarmUp(scenario, 1, 10.0, tmp_path)
    with pytest.raises(TrafficError, match=r"during the warm-up: .*missing\.net\.xml"):
        warm_up.state()
    warm_up.stop()


def test_a_warm_up_that_is_killed(tmp_path):
    warm_up = WarmUp(TOWN.sumocfg, 1, 3600.0, tmp_path)
    warm_up.stop()
    with pytest.raises(TrafficError, match="stopped by signal 9"):
        warm_up.state()
