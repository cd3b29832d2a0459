"""Estimate of the duration of a run before its start."""

import pytest

from cosim.capture.config import RunConfig
from cosim.capture.time_estimate import TownSize, estimate_s, machine_slowness, time_in_words
from sensors.sensor_model import load_sensor


def estimated(workers: int = 1, slowness: float = 1.0, **changes) -> float:
    config = RunConfig(**{"town": "town01", "frames": 1000, **changes})
    return estimate_s(config, [load_sensor(config.sensor)], workers, slowness)


def test_more_work_takes_longer():
    usual = estimated()
    assert estimated(frames=2000) == pytest.approx(2 * usual, rel=0.05)
    assert estimated(images=()) < estimated(images=("image_2",)) < usual
    assert estimated(sensor="vlp16") < usual
    assert estimated(frames_per_episode=500) < usual < estimated(town="all")
    assert estimated(slowness=3.0) == pytest.approx(3 * usual)


def test_a_large_network_takes_longer_but_its_world_grows_with_the_route_only():
    config = RunConfig(town="own.sumocfg", frames=25)
    sensors = [load_sensor(config.sensor)]
    town, city, region = (
        TownSize(round(km * 20), km * 1000.0, (side, side)) for km, side in ((40, 1e3), (2500, 8e3), (10_000, 16e3))
    )
    takes = [estimate_s(config, sensors, 1, sizes={"own.sumocfg": size}) for size in (town, city, region)]
    assert estimate_s(config, sensors, 1) < takes[0] < takes[1] < takes[2]
    assert city.built_m(200.0) == pytest.approx(region.built_m(200.0)) and town.built_m(200.0) == town.length_m
    assert city.built_m(200.0) < city.built_m(2000.0) < 0.2 * city.length_m


def test_workers_help_as_far_as_there_are_processors_and_episodes(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 4)
    assert estimated(2) == pytest.approx(estimated(1) / 2, rel=0.05)
    assert estimated(4) == estimated(16)
    assert estimated(4, frames=20) == estimated(1, frames=20)


def test_a_machine_takes_some_time():
    assert machine_slowness() > 0


@pytest.mark.parametrize(("seconds", "words"), [(12, "12 s"), (600, "10 min"), (9000, "2.5 h")])
def test_times_in_words(seconds, words):
    assert time_in_words(seconds) == words
