"""Frames per second for users: default settings with full traffic, episodes and worlds."""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from cosim.capture.config import RunConfig
from cosim.capture.runner import run
from cosim.engine import JobEvent, LocalEngine
from tests.bench.rows import Row

_SEED = 4
_TOWNS, _FRAMES, _WORKERS = ("town01", "town05", "all"), (25, 100, 500), (1, 2)
_TARGETS = {("town05", 500, 1): "0.20 s", ("town05", 500, 2): "9 frames/s"}


@dataclass(frozen=True)
class Measured:
    """A whole run, start included.

    Attributes:
        wall_s: time on the clock.
        cpu_s: processor time of all its processes.
        first_frame_s: time on the clock until the first frame.
        peak_bytes: most memory of a worker.
    """

    wall_s: float
    cpu_s: float
    first_frame_s: float
    peak_bytes: int


def measured(config: RunConfig, workers: int) -> Measured:
    """Record a drive and throw it away."""
    stamps: list[float] = []
    peaks: list[int] = []

    def on_event(event: JobEvent) -> None:
        if event.kind == "frame":
            stamps.append(time.monotonic())
        elif event.kind == "task":
            peaks.append(event.peak_bytes)

    before, started = _children_s(), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        run(config, Path(folder) / "drive", engine=LocalEngine(workers), on_event=on_event)
        wall_s = time.monotonic() - started
    return Measured(wall_s, _children_s() - before, stamps[0] - started, max(peaks, default=0))


def rows() -> Iterator[Row]:
    """A line for every town, length and number of workers."""
    peak = 0
    for town in _TOWNS:
        for frames in _FRAMES:
            for workers in _WORKERS:
                took = measured(RunConfig(town=town, frames=frames, seed=_SEED), workers)
                peak = max(peak, took.peak_bytes)
                yield Row(
                    f"{town}, {frames} frames, {workers} worker{'s' if workers > 1 else ''}",
                    f"{frames / took.wall_s:.1f} frames/s, {took.cpu_s / frames:.2f} s of CPU a frame, "
                    f"first after {took.first_frame_s:.0f} s",
                    _TARGETS.get((town, frames, workers), ""),
                )
    yield Row("memory of a worker, at most", f"{peak / 2**20:.0f} MiB", "1024")


def _children_s() -> float:
    """Processor time of all ended processes so far [s], which depends little on other load of the machine."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
