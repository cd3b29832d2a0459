"""Where the time of a frame goes, and what it takes on disk."""

from __future__ import annotations

import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

from cosim.capture import recorder as recording
from cosim.capture.config import RunConfig
from cosim.capture.episode import run_episode
from cosim.capture.plan import plan_episodes
from cosim.capture.recorder import Recorder
from cosim.capture.rig_lidars import RigLidars
from cosim.capture.rig_sensors import rig_sensors
from cosim.capture.runner import run
from cosim.drives.writer import DriveWriter
from cosim.labels.labelling import Labeller
from cosim.scene.bridge import Bridge
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.variants import PAPER, make_variants
from sensors.cameras import CameraRenderer
from sensors.sensor_model import SensorModel
from sensors.tracing import Tracer
from tests.bench.rows import Row
from tests.bench.stages import timed

_STAGED, _VARIED = 20, 8
_SEED = 1
_STAGES: dict[str, tuple[Any, str]] = {
    "traffic and motion": (DrivenTraffic, "advance"),
    "bridge": (Bridge, "place"),
    "LiDAR trace": (Tracer, "trace"),
    "LiDAR points": (SensorModel, "measure"),
    "cameras": (CameraRenderer, "render"),
    "labels": (Labeller, "label"),
    "points, rays, calibration": (RigLidars, "files"),
    "image files": (recording, "encode_products"),
    "hits file": (RigLidars, "hit_files"),
    "checksums and writing": (DriveWriter, "write_frame"),
}


def stage_rows() -> Iterator[Row]:
    """Milliseconds of one process's own time, stage by stage."""
    config = RunConfig(frames=_STAGED + 2, frames_per_episode=_STAGED + 2, seed=_SEED)
    plan = plan_episodes(config)[0]
    spent: defaultdict[str, float] = defaultdict(float)
    started: list[float] = []

    def follow(_: str) -> None:
        started.append(time.process_time())
        if len(started) == 2:  # models and programs are made by now
            spent.clear()

    with tempfile.TemporaryDirectory() as folder, ExitStack() as patches:
        for stage, (owner, name) in _STAGES.items():
            patches.enter_context(patch.object(owner, name, timed(getattr(owner, name), stage, spent)))
        recorder = Recorder(config, rig_sensors(config), DriveWriter(Path(folder)))
        run_episode(plan, config, recorder.move_to(plan), recorder, done=(), on_frame=follow)
        recorder.close()
    frames = len(started) - 2
    total = (started[-1] - started[1]) / frames
    yield Row("all", f"{total * 1e3:.0f} ms")
    for stage in _STAGES:
        yield Row(stage, f"{spent[stage] / frames * 1e3:.1f} ms, {spent[stage] / frames / total:.0%}")
    rest = total - sum(spent.values()) / frames
    yield Row("rest", f"{rest * 1e3:.1f} ms, {rest / total:.0%}")


def size_rows() -> Iterator[Row]:
    """Disk, and the making of variants after."""
    with tempfile.TemporaryDirectory() as folder:
        few = Path(folder) / "few"
        run(RunConfig(frames=_VARIED, frames_per_episode=_VARIED, seed=_SEED), few)
        sizes = _bytes_a_frame(few)
        hits = sizes.pop("hits")
        yield Row("a frame on disk", f"{sum(sizes.values()) / 1e6:.2f} MB, hits {hits / 1e6:.2f} MB more")
        started = time.monotonic()
        make_variants(few, ",".join(PAPER), Path(folder) / "variants")
        seconds = (time.monotonic() - started) / _VARIED
        yield Row(f"cosim variants, the paper's {len(PAPER)}, one worker, start included", f"{seconds:.2f} s a frame")


def _bytes_a_frame(drive: Path) -> dict[str, float]:
    """Mean size by folder, of what each frame has for itself."""
    names = {path.stem for path in (drive / "velodyne").iterdir()}
    sizes: Counter[str] = Counter()
    for path in drive.rglob("*"):
        if path.stem in names:
            sizes[path.parent.name] += path.stat().st_size
    return {folder: size / len(names) for folder, size in sizes.items()}
