"""How the time of a first-hit scan grows with vehicles, triangles and beams."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from assets import Mesh, build_model
from sensors.pattern import load_pattern
from sensors.scene import Scene
from sensors.tracing import Tracer
from tests.bench.rows import Row, best_s
from tests.bench.scenes import shown_frames

_REPEATS = 5
_VEHICLES = (0, 20, 40, 80, 160)
_GROUND_CELLS = (50, 150, 450)
_PATTERNS = ("vlp16", "hdl32e", "hdl64e")


def rows() -> Iterator[Row]:
    """A line each: sizes, and milliseconds of this thread."""
    shown = next(shown_frames(1, 1))
    tracer = _tracer("hdl64e")
    nearest = {count: shown.nearest(count) for count in _VEHICLES}
    yield _line(
        "nearest road users",
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
        "triangles of bare ground",
        {
            name: best_s(lambda scene=scene: tracer.trace(scene, pose, nobody), _REPEATS)
            for name, scene in grounds.items()
        },
    )
    tracers = [_tracer(name) for name in _PATTERNS]
    yield _line(
        "beams",
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
