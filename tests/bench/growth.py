"""How the cost of a frame grows: with who is in town, with triangles and beams, with workers and episodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from assets import Mesh, build_model
from cosim.capture.config import RunConfig
from sensors.pattern import load_pattern
from sensors.scene import Scene
from sensors.tracing import Tracer
from sumo_nets import DemandConfig
from tests.bench.rates import measured
from tests.bench.rows import Row, best_s
from tests.bench.scenes import shown_frames

_REPEATS = 5
_VEHICLES = (0, 20, 40, 80, 160)
_GROUND_CELLS = (50, 150, 450)
_PATTERNS = ("vlp16", "hdl32e", "hdl64e")
_IN_TOWN = (75, 150, 300, 450)
_SOME = (10, 40)  # frames
_EPISODES, _WORKERS = (1, 2, 4), (1, 2)
_SEED = 4


def rows() -> Iterator[Row]:
    """A line each: sizes, and what they cost."""
    yield from _scan_rows()
    yield from _frame_rows()


def _frame_rows() -> Iterator[Row]:
    """Processor time of a frame within a running episode, and of whole drives."""
    yield Row(
        f"a frame, of the town's vehicles: {' / '.join(map(str, _IN_TOWN))}",
        f"{' / '.join(f'{_frame_s(_crowd(count)):.2f}' for count in _IN_TOWN)} s",
    )
    yield Row(
        f"a frame, beams of {' / '.join(_PATTERNS)}",
        f"{' / '.join(f'{_frame_s(_crowd(300, sensor=name)):.2f}' for name in _PATTERNS)} s",
    )
    drives = [RunConfig(town="town05", frames=25 * count, seed=_SEED) for count in _EPISODES]
    yield Row(
        f"a frame, start included, of episodes: {' / '.join(map(str, _EPISODES))}",
        f"{' / '.join(f'{measured(drive, 1).cpu_s / drive.frames:.2f}' for drive in drives)} s",
    )
    took = [measured(drives[-1], workers) for workers in _WORKERS]
    yield Row(
        f"{drives[-1].frames} frames by workers: {' / '.join(map(str, _WORKERS))}",
        f"{' / '.join(f'{drives[-1].frames / one.wall_s:.1f}' for one in took)} frames/s, "
        f"{' / '.join(f'{one.cpu_s / drives[-1].frames:.2f}' for one in took)} s of CPU a frame",
    )


def _crowd(vehicles: int, **changes: Any) -> RunConfig:
    """A drive in a town with so many vehicles, a third of them driving."""
    driving, walking = vehicles // 3, 40
    population = DemandConfig(
        driving=(driving, driving), parked=(vehicles - driving, vehicles - driving), walking=(walking, walking)
    )
    return RunConfig(town="town05", seed=_SEED, population=population, frames_per_episode=100, **changes)


def _frame_s(config: RunConfig) -> float:
    """Processor time of a frame: what some frames more cost."""
    few, more = (measured(config.model_copy(update={"frames": count}), 1).cpu_s for count in _SOME)
    return (more - few) / (_SOME[1] - _SOME[0])


def _scan_rows() -> Iterator[Row]:
    """Milliseconds of this thread for a first-hit scan."""
    shown = next(shown_frames(1, 1))
    tracer = _tracer("hdl64e")
    nearest = {count: shown.nearest(count) for count in _VEHICLES}
    yield _line(
        "first-hit scan, nearest road users",
        {
            str(count): best_s(lambda others=others: tracer.trace(shown.scene, shown.pose, others), _REPEATS)
            for count, others in nearest.items()
        },
    )
    nobody = shown.nearest(0)
    pose = np.eye(4)
    pose[2, 3] = 1.73
    grounds = {f"{2 * cells**2:,}": Scene(_ground(cells), build_model) for cells in _GROUND_CELLS}
    yield _line(
        "first-hit scan, triangles of bare ground",
        {
            name: best_s(lambda scene=scene: tracer.trace(scene, pose, nobody), _REPEATS)
            for name, scene in grounds.items()
        },
    )
    tracers = [_tracer(name) for name in _PATTERNS]
    yield _line(
        "first-hit scan, beams",
        {
            f"{len(fan.rays):,}": best_s(lambda fan=fan: fan.trace(shown.scene, shown.pose, shown.others), _REPEATS)
            for fan in tracers
        },
    )


def _line(what: str, seconds: Mapping[str, float]) -> Row:
    return Row(f"{what}: {' / '.join(seconds)}", f"{' / '.join(f'{value * 1e3:.1f}' for value in seconds.values())} ms")


def _tracer(name: str) -> Tracer:
    pattern = load_pattern(name)
    return Tracer(pattern.rays(), pattern.range_m)


def _ground(cells: int, half_m: float = 200.0) -> Mesh:
    ticks = np.linspace(-half_m, half_m, cells + 1)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    row = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (corner.ravel() for corner in (row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    # gentle waves, so that neighbours are no plane
    z = 0.02 * np.sin(x / 3) * np.cos(y / 3)
    return Mesh.of(np.stack([x.ravel(), y.ravel(), z.ravel()], 1), faces, "asphalt")
