"""A process that records episodes: it builds the town once, then takes episodes from a queue."""

from __future__ import annotations

from multiprocessing.queues import Queue
from pathlib import Path

from cosim.config import RunConfig
from cosim.drive_writer import DriveWriter
from cosim.episode import run_episode
from cosim.plan import EpisodePlan
from cosim.processes import Event, telling


def work(config: RunConfig, folder: Path, done: frozenset[str], tasks: Queue, events: Queue, threads: int) -> None:
    """Record episodes until the queue gives None, with so many threads."""
    with telling(events):
        _record_all(config, folder, done, tasks, events, threads)


def _record_all(
    config: RunConfig, folder: Path, done: frozenset[str], tasks: Queue, events: Queue, threads: int
) -> None:
    from cosim.recorder import Recorder
    from sensors.sensor_model import load_sensor

    recorder = Recorder(config, load_sensor(config.sensor), DriveWriter(folder), threads=threads)
    try:
        while True:
            plan: EpisodePlan | None = tasks.get()
            if plan is None:
                return
            town = recorder.move_to(plan)
            events.put(Event("ready"))
            run_episode(plan, config, town, recorder, done=done, on_frame=lambda name: events.put(Event("frame", name)))
            events.put(Event("task", str(plan.number)))
    finally:
        recorder.close()
