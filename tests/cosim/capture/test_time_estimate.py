"""Estimate of the duration of a run before its start."""

import pytest

from cosim.capture.config import RunConfig
from cosim.capture.time_estimate import estimate_s, machine_slowness, time_in_words
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
