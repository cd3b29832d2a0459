"""The main job: plan episodes, share them among worker processes, finish the drive."""

from __future__ import annotations

import multiprocessing
import os
import queue
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import yaml

from assets.external import load_external
from cosim.config import RunConfig
from cosim.drive_writer import DriveWriter
from cosim.errors import CosimError
from cosim.plan import EpisodePlan, plan_episodes
from cosim.worker import Event, work
from sensors.sensor_model import SensorModel, load_sensor
from sumo_nets import read_town

_POLL_S = 0.5
_PATIENCE_S = 10.0
# Matrix products here are too small for BLAS to gain by threads; on busy cores it loses much.
_WITHOUT_BLAS_THREADS = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
_REPORTED_PACKAGES = ("cosim", "eclipse-sumo", "embreex", "numpy", "trimesh", "pyrender2")


class RunError(CosimError):
    """A run could not go on."""


@dataclass(frozen=True)
class RunResult:
    """What a run left.

    Attributes:
        folder: the drive.
        frames: frames in it.
        points: points in them.
        recorded: frames this call recorded; the rest were there.
    """

    folder: Path
    frames: int
    points: int
    recorded: int


def run(
    config: RunConfig,
    folder: Path,
    *,
    workers: int = 1,
    on_start: Callable[[int, int], None] = lambda done, total: None,
    on_event: Callable[[Event], None] = lambda event: None,
) -> RunResult:
    """Record a drive, or go on with an interrupted one; the bytes depend on `config` alone.

    Args:
        config: what to record.
        folder: where; made if need be.
        workers: processes to share the episodes.
        on_start: told how many frames are there already, and of how many.
        on_event: told of every event of the workers.

    Raises:
        CosimError: the folder, the town, the sensor or the disk refuses; frames already written stay.
        AssetError, TownError, SensorError, CameraError: likewise.
    """
    if workers < 1:
        raise RunError(f"workers is {workers}; give 1 or more")
    sensor = load_sensor(config.sensor)
    for town in config.towns:
        read_town(town)
    load_external(config.external_vehicles)
    writer = DriveWriter(folder)
    if not writer.open(_settings(config)):
        done = frozenset(writer.manifest())
        on_start(len(done), config.frames)
        pending = _pending(plan_episodes(config), writer.notes(), config.collection.attempts)
        with _workers(config, folder, done, pending, workers) as (processes, events):
            _follow(processes, events, len(pending), on_event)
        _finish(writer, config, sensor)
        recorded = len(writer.manifest()) - len(done)
    else:
        on_start(config.frames, config.frames)
        recorded = 0
    entries = writer.manifest().values()
    return RunResult(folder, len(entries), sum(entry["counts"]["points"] for entry in entries), recorded)


def _pending(plans: list[EpisodePlan], notes: Mapping[tuple[int, int], dict], attempts: int) -> list[EpisodePlan]:
    """Episodes that have not come to their end, those of one place together."""
    ended = {
        number for (number, attempt), note in notes.items() if note["ended"] == "complete" or attempt == attempts - 1
    }
    left = [plan for plan in plans if plan.number not in ended]
    return sorted(left, key=lambda plan: (plan.town, plan.world, plan.number))


@contextmanager
def _workers(
    config: RunConfig, folder: Path, done: frozenset[str], pending: list[EpisodePlan], count: int
) -> Iterator[tuple[list[BaseProcess], Any]]:
    """Spawned processes with all episodes queued; ended on the way out, whatever happened."""
    context = multiprocessing.get_context("spawn")
    tasks, events = context.Queue(), context.Queue()
    count = min(count, len(pending))
    threads = max(1, (os.cpu_count() or 1) // max(count, 1))
    environment = {**_WITHOUT_BLAS_THREADS, "LP_NUM_THREADS": str(threads if threads > 1 else 0)}
    for plan in [*pending, *[None] * count]:
        tasks.put(plan)
    processes: list[BaseProcess] = [
        context.Process(target=work, args=(config, folder, done, tasks, events, threads), daemon=True)
        for _ in range(count)
    ]
    before = {name: os.environ.get(name) for name in environment}
    os.environ.update(environment)
    try:
        for process in processes:
            process.start()
        yield processes, events
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
        for process in processes:
            process.join(0.0 if process.exitcode is None else None)
            if process.is_alive():
                process.terminate()
                process.join(_PATIENCE_S)
        tasks.cancel_join_thread()
        events.cancel_join_thread()


def _follow(processes: list[BaseProcess], events: Any, episodes: int, on_event: Callable[[Event], None]) -> None:
    """Pass events on until all episodes are complete."""
    while episodes:
        try:
            event: Event = events.get(timeout=_POLL_S)
        except queue.Empty:
            dead = [process for process in processes if process.exitcode not in (None, 0)]
            if dead:
                raise RunError(
                    f"a worker process died (exit code {dead[0].exitcode}, often too little memory); "
                    "run the same command again to go on"
                ) from None
            continue
        if event.kind == "refused":
            raise RunError(event.text)
        if event.kind == "failed":
            raise RuntimeError(f"a worker failed:\n{event.text}")
        on_event(event)
        episodes -= event.kind == "episode"
    for process in processes:
        process.join(_PATIENCE_S)


def _settings(config: RunConfig) -> str:
    """What the bytes of a drive depend on: the effective configuration and the versions that made it."""
    document = {
        "kind": "simulated",
        "config": config.model_dump(mode="json"),
        "versions": {name: version(name) for name in _REPORTED_PACKAGES},
    }
    return yaml.safe_dump(document, sort_keys=False)


def _finish(writer: DriveWriter, config: RunConfig, sensor: SensorModel) -> None:
    entries = writer.manifest()
    names = sorted(entries)
    middle = (len(names) + 1) // 2
    files = {
        "ImageSets/train.txt": _lines(names[:middle]),
        "ImageSets/val.txt": _lines(names[middle:]),
        "ImageSets/trainval.txt": _lines(names),
        "pattern.yaml": sensor.pattern.to_yaml().encode(),
        "sensor.yaml": sensor.to_yaml().encode(),
    }
    summary = {
        "pattern": sensor.pattern.name,
        "sweep_s": sensor.pattern.sweep_s,
        "seed": config.seed,
        "sensor": yaml.safe_load(sensor.to_yaml()),
        "counts": {
            key: sum(entry["counts"][key] for entry in entries.values()) for key in ("points", "labels", "instances")
        }
        | {"frames": len(names), "episodes": len({entry["episode"] for entry in entries.values()})},
    }
    writer.finish(files, _settings(config) + yaml.safe_dump(summary, sort_keys=False))


def _lines(names: list[str]) -> bytes:
    return "".join(f"{name}\n" for name in names).encode()
