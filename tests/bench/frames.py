"""Frames a second of the whole job, where the time of a frame goes, and what it takes in memory and on disk."""

from __future__ import annotations

import functools
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

from cosim.capture import recorder as recording
from cosim.capture.config import RunConfig
from cosim.capture.episode import run_episode
from cosim.capture.plan import plan_episodes
from cosim.capture.recorder import Recorder
from cosim.capture.runner import run
from cosim.drives.writer import DriveWriter
from cosim.engine import Event, LocalEngine
from cosim.labels.labelling import Labeller
from cosim.scene.bridge import Bridge
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.variants import PAPER, make_variants
from sensors.cameras import CameraRenderer
from sensors.sensor_model import SensorModel, load_sensor
from sensors.tracing import Tracer
from sumo_nets import DemandConfig
from tests.bench.rows import Row

_STAGED, _EACH, _VARIED = 20, 40, 8
_SEED = 1
_POPULATIONS = {
    "town07": ("60 driving, 30 parked, 30 walking", DemandConfig(driving=(60, 60), parked=(30, 30), walking=(30, 30))),
    "town01": ("as many as is usual there", DemandConfig()),
}
_STAGES: dict[str, tuple[Any, str]] = {
    "traffic and motion": (DrivenTraffic, "advance"),
    "bridge": (Bridge, "place"),
    "LiDAR trace": (Tracer, "trace"),
    "LiDAR points": (SensorModel, "measure"),
    "cameras": (CameraRenderer, "render"),
    "labels": (Labeller, "label"),
    "points, rays, labels, twin": (Recorder, "_files"),
    "image files": (recording, "encode_products"),
    "hits file": (recording, "encode_hits"),
    "checksums and writing": (DriveWriter, "write_frame"),
}


def stage_rows() -> Iterator[Row]:
    """Milliseconds of one process's own time, stage by stage."""
    config = RunConfig(frames=_STAGED + 2, frames_per_episode=_STAGED + 2, seed=_SEED)
    plan = plan_episodes(config)[0]
    spent: Counter[str] = Counter()
    begun: list[float] = []

    def follow(_: str) -> None:
        begun.append(time.process_time())
        if len(begun) == 2:  # models and programs are made by now
            spent.clear()

    with tempfile.TemporaryDirectory() as folder, ExitStack() as patches:
        for stage, (owner, name) in _STAGES.items():
            patches.enter_context(patch.object(owner, name, _counted(getattr(owner, name), stage, spent)))
        recorder = Recorder(config, load_sensor(config.sensor), DriveWriter(Path(folder)))
        run_episode(plan, config, recorder.move_to(plan), recorder, done=(), on_frame=follow)
        recorder.close()
    frames = len(begun) - 2
    total = (begun[-1] - begun[1]) / frames
    yield Row("all", f"{total * 1e3:.0f} ms")
    for stage in _STAGES:
        yield Row(stage, f"{spent[stage] / frames * 1e3:.1f} ms, {spent[stage] / frames / total:.0%}")
    rest = total - sum(spent.values()) / frames
    yield Row("rest", f"{rest * 1e3:.1f} ms, {rest / total:.0%}")


def rate_rows() -> Iterator[Row]:
    """Frames a second by workers; memory, disk, and variants after."""
    with tempfile.TemporaryDirectory() as folder:
        drive, peaks = Path(folder), []
        for town, (who, population) in _POPULATIONS.items():
            rates = {}
            for workers in (1, 2):
                drive = Path(folder) / f"{town}_{workers}"
                before = _children_s()
                rates[workers], peak = _rate(drive, workers, town, population)
                peaks.append(peak)
                own = (_children_s() - before) / (_EACH * workers)
                yield Row(
                    f"{town}, {who}, {workers} worker{'s' if workers > 1 else ''}",
                    f"{rates[workers]:.1f} frames/s, {rates[workers] / rates[1]:.2f} × one, {own:.2f} s of CPU a frame",
                    "10" if population.driving and workers == 2 else "",
                )
        yield Row("memory of a worker, at most", f"{max(peaks) / 2**20:.0f} MiB", "1024")
        sizes = _bytes_a_frame(drive)
        hits = sizes.pop("hits")
        yield Row("a frame on disk", f"{sum(sizes.values()) / 1e6:.2f} MB, hits {hits / 1e6:.2f} MB more")
        few = Path(folder) / "few"
        run(RunConfig(frames=_VARIED, frames_per_episode=_VARIED, seed=_SEED), few)
        begun = time.monotonic()
        make_variants(few, ",".join(PAPER), Path(folder) / "variants")
        seconds = (time.monotonic() - begun) / _VARIED
        yield Row(f"cosim variants, the paper's {len(PAPER)}, one worker, start included", f"{seconds:.2f} s a frame")


def _counted(function: Callable[..., Any], stage: str, spent: Counter[str]) -> Callable[..., Any]:
    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        begun = time.thread_time()
        try:
            return function(*args, **kwargs)
        finally:
            spent[stage] += time.thread_time() - begun  # type: ignore[assignment]

    return wrapper


def _rate(drive: Path, workers: int, town: str, population: DemandConfig) -> tuple[float, int]:
    """Frames a second while all workers record: from the first frames, which wait for models, to the first end.

    And the most memory that one of them has held, in bytes.
    """
    stamps: list[float] = []
    ended: list[int] = []
    peaks: list[int] = []

    def on_event(event: Event) -> None:
        if event.kind == "frame":
            stamps.append(time.monotonic())
        elif event.kind == "task":
            ended.append(len(stamps))
            peaks.append(event.peak_bytes)

    config = RunConfig(town=town, frames=_EACH * workers, frames_per_episode=_EACH, seed=_SEED, population=population)
    run(config, drive, engine=LocalEngine(workers), on_event=on_event)
    first, last = 2 * workers, ended[0] - 1
    return (last - first) / (stamps[last] - stamps[first]), max(peaks)


def _children_s() -> float:
    """Processor time of all ended processes so far [s], which others on the machine hardly lengthen."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _bytes_a_frame(drive: Path) -> dict[str, float]:
    """Mean size by folder, of what each frame has for itself."""
    names = {path.stem for path in (drive / "velodyne").iterdir()}
    sizes: Counter[str] = Counter()
    for path in drive.rglob("*"):
        if path.stem in names:
            sizes[path.parent.name] += path.stat().st_size
    return {folder: size / len(names) for folder, size in sizes.items()}
