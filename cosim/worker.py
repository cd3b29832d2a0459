"""A process that records episodes: it builds the town once, then takes episodes from a queue."""

from __future__ import annotations

import multiprocessing
import os
import threading
import traceback
from dataclasses import dataclass
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Literal

from cosim.config import RunConfig
from cosim.drive_writer import DriveWriter
from cosim.episode import run_episode
from cosim.plan import EpisodePlan
from cosim.user_errors import USER_ERRORS


@dataclass(frozen=True)
class Event:
    """What a worker tells the runner.

    Attributes:
        kind: `ready` (the town is built), `frame` (one is on disk), `episode` (one is complete), `refused` (the
            user's mistake, in `text`) or `failed` (ours: `text` is a traceback).
        text: frame name or message.
    """

    kind: Literal["ready", "frame", "episode", "refused", "failed"]
    text: str = ""


def work(config: RunConfig, folder: Path, done: frozenset[str], tasks: Queue, events: Queue, threads: int) -> None:
    """Record episodes until the queue gives None, with so many threads."""
    _end_with_parent()
    try:
        _record_all(config, folder, done, tasks, events, threads)
    except USER_ERRORS as error:
        events.put(Event("refused", str(error)))
    except Exception:  # noqa: BLE001 — whatever it is, the runner must hear of it
        events.put(Event("failed", traceback.format_exc()))


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
            events.put(Event("episode", str(plan.number)))
    finally:
        recorder.close()


def _end_with_parent() -> None:
    """Die when the runner dies, however it dies, so that nobody writes on into a drive that is taken up again."""
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
