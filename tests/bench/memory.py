"""Whether workers' memory stays flat over a long drive, and how fast one is in all."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from cosim.capture.config import RunConfig
from cosim.capture.runner import run
from cosim.engine import JobEvent, LocalEngine
from tests.bench.rows import Row

_FRAMES, _EPISODE = 1000, 25
_SHARES = (0.1, 0.25, 0.5, 1.0)


def rows() -> Iterator[Row]:
    """The rate of a whole drive, and the most memory that any of two workers has held as it goes on."""
    peaks: list[float] = []

    def on_event(event: JobEvent) -> None:
        if event.kind == "task":
            peaks.append(max(event.peak_bytes / 2**20, peaks[-1] if peaks else 0.0))

    config = RunConfig(frames=_FRAMES, frames_per_episode=_EPISODE, seed=1, sensor="kitti")
    with tempfile.TemporaryDirectory() as folder:
        started = time.monotonic()
        run(config, Path(folder) / "drive", engine=LocalEngine(2), on_event=on_event)
        rate = _FRAMES / (time.monotonic() - started)
    counts = [round(share * len(peaks)) for share in _SHARES]
    frames = " / ".join(str(count * _EPISODE) for count in counts)
    figures = " / ".join(f"{peaks[count - 1]:.0f}" for count in counts)
    yield Row(f"{_FRAMES} frames, start and warm-ups included", f"{rate:.1f} frames/s")
    yield Row(f"a worker's peak after {frames} frames of sensor kitti", f"{figures} MiB", "1024")
