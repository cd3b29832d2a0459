"""Processor time of a frame against its floor: what the libraries alone need for the same frames.

The floor of a stage is the time within the calls that do its work: SUMO's step, one Embree query of the LiDAR's beams
in the static world, drawing and reading back in OpenGL, compression of the images and arrays, and writing the files
with one `fsync` each.
"""

from __future__ import annotations

import functools
import tempfile
import time
import zipfile
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np

from cosim.capture import recorder as recording
from cosim.capture.config import RunConfig
from cosim.capture.episode import run_episode
from cosim.capture.plan import plan_episodes
from cosim.capture.recorder import Recorder
from cosim.capture.rig_cameras import RigCameras
from cosim.capture.rig_lidars import RigLidars
from cosim.capture.rig_sensors import rig_sensors
from cosim.drives.writer import DriveWriter
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.starting import load_libsumo
from sensors.cameras.renderer import select_backend
from sensors.hits import Hits
from sensors.tracing import Tracer
from tests.bench.rows import Row
from tests.bench.stages import timed

_FRAMES, _SEED, _TOWN = 50, 1, "town05"
_GOAL = 1.6
_FAR_M = 120.0  # range of the default sensor
_OURS: dict[str, tuple[tuple[Any, str], ...]] = {
    "traffic": ((DrivenTraffic, "step"), (DrivenTraffic, "everyone")),
    "LiDAR": ((RigLidars, "scan"),),
    "cameras": ((RigCameras, "render"),),
    "encoding": ((recording, "_encode_products"), (RigLidars, "files"), (RigLidars, "hit_files")),
    "writing": ((DriveWriter, "write_frame"),),
}
_DRAWING = ("glMultiDrawElements", "glMultiDrawElementsIndirect", "glDrawArrays", "glReadPixels")


def rows() -> Iterator[Row]:
    """A line for every stage and for all, start included, of a drive of two episodes in one process."""
    config = RunConfig(town=_TOWN, frames=_FRAMES, seed=_SEED)
    ours: dict[str, float] = defaultdict(float)
    floor: dict[str, float] = defaultdict(float)
    with tempfile.TemporaryDirectory() as folder:
        total_s, start_s = _record(config, Path(folder) / "drive", ours, floor)
        floor["encoding"] = sum(map(_compression_s, Path(folder).rglob("0*.*")))
        floor["writing"] = _writing_s(Path(folder) / "drive", Path(folder) / "copy")
    for stage in _OURS:
        yield Row(stage, _figure(ours[stage], floor[stage]))
    yield Row("all but the start", _figure(total_s - start_s, sum(floor.values())))
    yield Row("all", _figure(total_s, sum(floor.values())), f"{_GOAL} ×")
    yield Row("start: until the first frame", f"{start_s:.1f} s")


def _record(config: RunConfig, folder: Path, ours: dict[str, float], floor: dict[str, float]) -> tuple[float, float]:
    """Record a drive; return the process's own time for all and until the first frame, without added queries [s]."""
    select_backend(config.backend)
    from OpenGL import GL

    first_s: list[float] = []
    added: dict[str, float] = defaultdict(float)

    def follow(_: str) -> None:
        if not first_s:
            first_s.append(time.process_time() - started - added["query"])
            ours.clear()
            floor.clear()

    with ExitStack() as patches:

        def count(owner: Any, name: str, stage: str, spent: dict[str, float]) -> None:
            patches.enter_context(patch.object(owner, name, timed(getattr(owner, name), stage, spent)))

        for stage, functions in _OURS.items():
            for owner, name in functions:
                count(owner, name, stage, ours)
        count(load_libsumo(), "simulationStep", "traffic", floor)
        for name in _DRAWING:
            count(GL, name, "cameras", floor)
        patches.enter_context(patch.object(Tracer, "trace", _with_raw_query(Tracer.trace, ours, floor, added)))
        started = time.process_time()
        recorder = Recorder(config, rig_sensors(config), DriveWriter(folder))
        for plan in plan_episodes(config):
            run_episode(plan, config, recorder.move_to(plan), recorder, done=(), on_frame=follow)
        recorder.close()
        return time.process_time() - started - added["query"], first_s[0]


def _with_raw_query(
    trace: Callable[..., Hits], ours: dict[str, float], floor: dict[str, float], added: dict[str, float]
) -> Callable[..., Hits]:
    """`Tracer.trace`, followed by a query of the same beams in the static world that counts only for the floor."""

    @functools.wraps(trace)
    def wrapper(tracer: Tracer, scene: Any, pose: np.ndarray, *others: Any, **named: Any) -> Hits:
        hits = trace(tracer, scene, pose, *others, **named)
        direction = np.ascontiguousarray(hits.direction)
        origin = np.repeat(pose[None, :3, 3].astype(np.float32), len(direction), axis=0)
        limit = np.full(len(direction), _FAR_M, np.float32)
        started = time.thread_time()
        scene.static.first_hit(origin, direction, limit)
        spent_s = time.thread_time() - started
        floor["LiDAR"] += spent_s
        ours["LiDAR"] -= spent_s
        added["query"] += spent_s
        return hits

    return wrapper


def _compression_s(path: Path) -> float:
    """Time in which a file's image or its compressed arrays are compressed again [s]."""
    if path.suffix == ".png":
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert image is not None  # just written
        started = time.thread_time()
        cv2.imencode(".png", image)
        return time.thread_time() - started
    if path.suffix != ".npz":
        return 0.0
    with zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if member.compress_type == zipfile.ZIP_DEFLATED]
        contents = [archive.read(member) for member in members]
    started = time.thread_time()
    for content in contents:
        zlib.compress(content, 1)
    return time.thread_time() - started


def _writing_s(drive: Path, copy: Path) -> float:
    """Time in which the files of all frames are written with one `fsync` each [s]."""
    copy.mkdir()
    spent_s = 0.0
    for number, path in enumerate(sorted(drive.rglob("0*.*"))):
        content = path.read_bytes()
        started = time.thread_time()
        DriveWriter(copy).write(f"{number}", content)
        spent_s += time.thread_time() - started
    return spent_s


def _figure(ours_s: float, floor_s: float) -> str:
    """Time of a frame, of its floor, and their ratio."""
    ours_ms, floor_ms = 1e3 * ours_s / _FRAMES, 1e3 * floor_s / _FRAMES
    return f"{ours_ms:.0f} ms, floor {floor_ms:.0f} ms: {ours_s / floor_s:.2f} ×"
