"""Frames a second of the whole job, and where the time of a frame goes."""

from __future__ import annotations

import cProfile
import pstats
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from rich.table import Table

from cosim.config import RunConfig
from cosim.drive_writer import DriveWriter
from cosim.episode import run_episode
from cosim.plan import plan_episodes
from cosim.recorder import Recorder
from cosim.runner import run
from sensors.sensor_model import load_sensor

_PROFILED = 20
_TIMED = 60
_STAGES = {
    "traffic and motion": ("living.py", "advance"),
    "bridge": ("bridge.py", "place"),
    "LiDAR trace": ("tracing.py", "trace"),
    "LiDAR points": ("sensor_model.py", "measure"),
    "cameras": ("renderer.py", "render"),
    "labels": ("labelling.py", "label"),
    "encode files": ("recorder.py", "_files"),
    "encode hits": ("hits_file.py", "encode_hits"),
    "write": ("drive_writer.py", "write_frame"),
}


def stage_table() -> Table:
    """Share of each stage in a frame, one process."""
    config = RunConfig(frames=_PROFILED + 2, frames_per_episode=_PROFILED + 2, seed=1)
    plan = plan_episodes(config)[0]
    profile = cProfile.Profile()
    seen: list[str] = []

    def follow(name: str) -> None:
        seen.append(name)
        if len(seen) == 2:  # models and programs are made by now
            profile.enable()

    with tempfile.TemporaryDirectory() as folder:
        recorder = Recorder(config, load_sensor(config.sensor), DriveWriter(Path(folder)))
        run_episode(plan, config, recorder.move_to(plan), recorder, done=(), on_frame=follow)
        profile.disable()
        recorder.close()
    times = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    total = sum(entry[2] for entry in times.values())
    result = Table(title=f"One process: {total / _PROFILED * 1e3:.0f} ms a frame")
    result.add_column("stage")
    result.add_column("ms a frame", justify="right")
    result.add_column("share", justify="right")
    rest = total
    for stage, (file, function) in _STAGES.items():
        seconds = sum(
            entry[3] for (path, _, name), entry in times.items() if path.endswith("/" + file) and name == function
        )
        rest -= seconds
        result.add_row(stage, f"{seconds / _PROFILED * 1e3:.1f}", f"{seconds / total:.0%}")
    result.add_row("rest", f"{rest / _PROFILED * 1e3:.1f}", f"{rest / total:.0%}")
    return result


def rate_table() -> Table:
    """Frames a second with one and two workers, from each worker's first frame to the last."""
    rates = {workers: _rate(workers) for workers in (1, 2)}
    result = Table(title=f"town01, {_TIMED} frames: LiDAR with both hits, gray, depth, colour, labels, files")
    for column in ("workers", "frames/s", "ratio to one worker"):
        result.add_column(column, justify="right")
    for workers, rate in rates.items():
        result.add_row(str(workers), f"{rate:.1f}", f"{rate / rates[1]:.2f}")
    return result


def _rate(workers: int) -> float:
    stamps: list[float] = []

    def on_event(event: object) -> None:
        if getattr(event, "kind", "") == "frame":
            stamps.append(time.monotonic())

    _quietly(workers, on_event)
    # the first frames of each worker wait for its models to be built
    skipped = 2 * workers
    return (len(stamps) - 1 - skipped) / (stamps[-1] - stamps[skipped])


def _quietly(workers: int, on_event: Callable[[object], None]) -> None:
    config = RunConfig(frames=_TIMED, frames_per_episode=_TIMED // 2, seed=1)
    with tempfile.TemporaryDirectory() as folder:
        run(config, Path(folder) / "drive", workers=workers, on_event=on_event)
