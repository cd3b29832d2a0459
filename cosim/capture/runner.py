"""Record a simulated drive: plan the episodes, distribute them to worker processes, finish the drive."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from assets.external import load_external
from assets.streets import Streets
from cosim.capture.config import RunConfig
from cosim.capture.disk_estimate import check_disk_space, estimate_bytes
from cosim.capture.plan import EpisodePlan, plan_episodes
from cosim.capture.replayed import replay_of, signal_notes
from cosim.capture.rig_sensors import folder_of, rig_sensors
from cosim.capture.worker import EpisodeRecording, RecordJob
from cosim.drives.writer import DriveWriter
from cosim.engine import Engine, JobEvent, LocalEngine, Skipped
from cosim.errors import CosimError
from sensors.sensor_model import SensorModel
from sumo_nets import RECIPES, read_town

_log = logging.getLogger(__name__)
_REPORTED_PACKAGES = ("cosim", "eclipse-sumo", "embreex", "numpy", "trimesh", "pyrender2")


class RunError(CosimError):
    """A run could not be completed."""


@dataclass(frozen=True)
class RunResult:
    """Result of a run.

    Attributes:
        folder: folder of the drive.
        frames: number of frames in the drive.
        points: number of points in all frames.
        recorded: number of frames recorded by this call; the other frames existed already.
    """

    folder: Path
    frames: int
    points: int
    recorded: int


def run(
    config: RunConfig,
    folder: Path,
    *,
    engine: Engine | None = None,
    on_start: Callable[[int, int], None] = lambda done, total: None,
    on_towns: Callable[[Mapping[str, Streets]], None] = lambda streets: None,
    on_event: Callable[[JobEvent], None] = lambda event: None,
) -> RunResult:
    """Record a drive, or resume an interrupted one; its bytes depend only on `config`.

    Args:
        config: configuration of the run.
        folder: folder of the drive; created if it does not exist.
        engine: engine that runs the episodes; by default one local process.
        on_start: called with the number of existing frames and the total number of frames.
        on_towns: called before `on_start` with the streets of the towns that are not built in, by name.
        on_event: called with every event of the workers.

    Raises:
        CosimError: the folder, the town, the sensor or the free disk space is unsuitable, another process writes to the
            folder, or every episode fails. Frames already written are kept.
        AssetError, TownError, SensorError, CameraError: a mesh, town, sensor or camera cannot be used.
    """
    sensors = rig_sensors(config)
    inferred: dict[str, Any] = {}
    origins: dict[str, tuple[float, float, float]] = {}
    streets: dict[str, Streets] = {}
    has_inputs = config.world is not None or config.trajectories is not None
    for name in config.towns:
        if name in RECIPES and not has_inputs:
            continue  # a built-in town has no notes, and the workers read it anyway
        town = read_town(name)
        if name not in RECIPES:
            streets[name] = town.streets
        if any(town.streets.origin_m):
            origins[town.name] = town.streets.origin_m
        for note in town.notes:
            _log.warning("%s", note)
        if config.world is not None:
            config.world.read(town.streets)
        if config.trajectories is not None:
            replay = replay_of(config.trajectories, town)
            inferred = dict(replay.tracks.inferred)
            replay.draw_ego(config.ego, 0.0, np.random.default_rng(0))
            for note in (*replay.tracks.notes, *signal_notes(replay, town)):
                _log.warning("%s", note)
        elif town.streets_only:
            raise RunError(
                f"{name}: contains a road network but no traffic; give --trajectories, or a .sumocfg with routes"
            )
    on_towns(streets)
    del streets
    load_external(config.external_vehicles)
    writer = DriveWriter(folder)
    remaining = 1 - len(writer.manifest()) / config.frames
    check_disk_space(round(estimate_bytes(config, list(sensors.values())) * remaining), folder)
    with writer.alone():
        if not writer.open(_settings(config)):
            done = frozenset(writer.manifest())
            on_start(len(done), config.frames)
            _record(writer, config, engine or LocalEngine(), on_event)
            _check_frames(writer)
            _finish(writer, config, sensors, inferred, origins)
            recorded = len(writer.manifest()) - len(done)
        else:
            on_start(config.frames, config.frames)
            recorded = 0
    entries = writer.manifest().values()
    return RunResult(folder, len(entries), sum(entry["counts"]["points"] for entry in entries), recorded)


def _record(writer: DriveWriter, config: RunConfig, engine: Engine, on_event: Callable[[JobEvent], None]) -> None:
    """Record the episodes that are not complete."""

    def make_task(plan: EpisodePlan) -> EpisodeRecording:
        return EpisodeRecording(plan, frozenset(writer.manifest()).intersection(plan.frames))

    plans = _select_pending(plan_episodes(config), writer.notes(), config.collection.attempts)
    skipped = engine.share_out(
        RecordJob(config, writer.folder.absolute()),
        [make_task(plan) for plan in plans],
        on_event,
        refresh_task=lambda recording: make_task(recording.plan),
    )
    if plans and len(skipped) == len(plans):
        raise RunError(f"every episode failed, the last because {skipped[-1].reason}; run again to try once more")
    for skip in skipped:
        writer.write_note(_skip_note(skip, config))


def _check_frames(writer: DriveWriter) -> None:
    """Raise RunError if the drive has no frame."""
    if not writer.manifest():
        ended = sorted({str(note["ended"]) for note in writer.notes().values()})
        raise RunError(
            f"no simulation produced a frame ({'; '.join(ended)}); the ego vehicle must move: "
            "check the traffic, or lower collection.min_travel_m or company_m"
        )


def _skip_note(skip: Skipped, config: RunConfig) -> dict[str, object]:
    """Manifest entry that marks an episode as failed, so that it is not tried again."""
    plan: EpisodePlan = skip.task.plan
    return {
        "episode": plan.number,
        "attempt": config.collection.attempts - 1,
        "town": plan.town,
        "world": plan.world,
        "frames": 0,
        "ended": f"given up after failing twice: {skip.reason}",
        "time_s": 0.0,
        "events": {},
    }


def _select_pending(
    plans: list[EpisodePlan], notes: Mapping[tuple[int, int], dict], attempts: int
) -> list[EpisodePlan]:
    """Episodes that are not complete, sorted by town and world."""
    finished = {
        number for (number, attempt), note in notes.items() if note["ended"] == "complete" or attempt == attempts - 1
    }
    pending = [plan for plan in plans if plan.number not in finished]
    return sorted(pending, key=lambda plan: (plan.town, plan.world, plan.number))


def _settings(config: RunConfig) -> str:
    """YAML text of the effective configuration and the package versions, which determine the bytes of a drive."""
    document = {
        "kind": "simulated",
        "config": config.model_dump(mode="json"),
        "versions": {name: version(name) for name in _REPORTED_PACKAGES},
    }
    return yaml.safe_dump(document, sort_keys=False)


def _finish(
    writer: DriveWriter,
    config: RunConfig,
    sensors: Mapping[str, SensorModel],
    inferred: Mapping[str, Any],
    origins: Mapping[str, tuple[float, float, float]],
) -> None:
    first = next(iter(sensors))
    sensor, rig = sensors[first], config.rig_used
    entries = writer.manifest()
    names = sorted(entries)
    middle = (len(names) + 1) // 2
    files = {
        "ImageSets/train.txt": _lines(names[:middle]),
        "ImageSets/val.txt": _lines(names[middle:]),
        "ImageSets/trainval.txt": _lines(names),
    }
    for name, model in sensors.items():
        folder = folder_of("" if name == first else name)
        files[f"{folder}pattern.yaml"] = model.pattern.to_yaml().encode()
        files[f"{folder}sensor.yaml"] = model.to_yaml().encode()
    summary = ({} if rig.kitti_row else {"label_camera": rig.reference.name}) | {
        "pattern": sensor.pattern.name,
        "sweep_s": sensor.pattern.sweep_s,
        "seed": config.seed,
        "sensor": yaml.safe_load(sensor.to_yaml()),
        "counts": {
            key: sum(entry["counts"][key] for entry in entries.values()) for key in ("points", "labels", "instances")
        }
        | {"frames": len(names), "episodes": len({entry["episode"] for entry in entries.values()})},
    }
    if origins:
        files["twin/origin.yaml"] = _origin_file(origins, config).encode()
    if inferred:
        summary["inferred"] = dict(inferred)
    writer.finish(files, _settings(config) + yaml.safe_dump(summary, sort_keys=False))


def _origin_file(origins: Mapping[str, tuple[float, float, float]], config: RunConfig) -> str:
    """Text of `twin/origin.yaml`: offset from the twin's coordinates to those of the network's files [m]."""
    values = {name: dict(zip("xyz", origin, strict=True)) for name, origin in origins.items()}
    if len(config.towns) == 1:
        return yaml.safe_dump(next(iter(values.values())), sort_keys=False)
    return yaml.safe_dump({"towns": values}, sort_keys=False)


def _lines(names: list[str]) -> bytes:
    return "".join(f"{name}\n" for name in names).encode()
