"""The LiDAR stage against one raw Embree query of the same beams on one merged static mesh."""

from __future__ import annotations

import importlib
import importlib.util
import os
import time
from collections.abc import Callable, Iterator

import numpy as np

from assets import Mesh
from sensors.effects.beams.dual_block import DualBlock
from sensors.effects.beams.sweep_motion import SweepMotion
from sensors.effects.surfaces.beam_divergence import BeamDivergence
from sensors.effects.surfaces.glass_transmission import GlassTransmission
from sensors.hits import Hits
from sensors.pattern import load_pattern
from sensors.scene import Scene
from sensors.sensor_model import SensorModel
from sensors.tracing import Tracer
from tests.bench.rows import Row, best_s
from tests.bench.scenes import Shown, embree_scene, shown_frames

_FRAMES, _REPEATS = 6, 7
_FAR_M = 120.0
_TARGETS = {"first hit": 1.5, "dual return": 2.2, "sweep motion": 2.5, "divergence, 5 rays a beam": 7.0}


def rows() -> Iterator[Row]:
    """Medians over frames of town01 of the best of several runs."""
    threads = os.cpu_count() or 1
    pattern = load_pattern("hdl64e")
    models = {
        "first hit": SensorModel(pattern),
        "dual return": SensorModel(pattern, (GlassTransmission(transmission=0.85, mode="dual"),)),
        "two optical centres": SensorModel(pattern, (DualBlock(upper_m=0.0405, lower_m=-0.0405),)),
        "sweep motion": SensorModel(pattern, (SweepMotion(sweep_s=pattern.sweep_s),)),
        "divergence, 5 rays a beam": SensorModel(pattern, (BeamDivergence(divergence_mrad=2.0, pulse_ns=6.0),)),
    }
    tracer = Tracer(pattern.rays(), pattern.range_m)
    ratios: dict[str, list[float]] = {name: [] for name in models}
    raw_s, shared, rivals, triangles, near = [], [], [], [], []
    for shown in shown_frames(_FRAMES, threads):
        merged = shown.merged
        raw = _raw_query(merged, tracer, shown.pose)
        raw_s.append(best_s(raw, _REPEATS))
        for name, model in models.items():
            stage = _stage(model, tracer, shown, shown.scene)
            ratios[name].append(best_s(stage, _REPEATS) / raw_s[-1])
        whole = _stage(models["first hit"], tracer, shown, shown.shared)
        shared.append(best_s(whole, _REPEATS, time.perf_counter) / best_s(raw, _REPEATS, time.perf_counter))
        rivals.append(_open3d_s(merged, tracer, shown.pose))
        triangles.append(len(merged.faces))
        near.append(int((np.linalg.norm(shown.others.poses[:, :2, 3] - shown.pose[:2, 3], axis=1) < 60).sum()))
    raw_ms, beams = float(np.median(raw_s)) * 1e3, len(tracer.rays)
    size = f"{np.median(triangles) / 1e6:.2f} M triangles, {np.median(near):.0f} road users within 60 m"
    yield Row(f"raw query: {beams:,} beams, {size}", f"{raw_ms:.1f} ms, {beams / raw_ms / 1e3:.1f} M rays/s")
    for name, values in ratios.items():
        ratio = float(np.median(values))
        figure = f"{ratio:.2f} × raw, {beams / raw_ms / ratio / 1e3:.2f} M beams/s"
        yield Row(f"{name}, one thread", figure, f"{_TARGETS[name]}" if name in _TARGETS else "")
    yield Row(f"first hit, {threads} threads / raw in one", f"{np.median(shared):.2f} × raw")
    if any(rivals):
        yield Row("Open3D's RaycastingScene, one thread", f"{np.median(rivals) / np.median(raw_s):.2f} × raw")
    else:
        yield Row("Open3D's RaycastingScene", "not installed")


def _stage(model: SensorModel, tracer: Tracer, shown: Shown, scene: Scene) -> Callable[[], object]:
    """All from the posed scene to the points, with what the stage promises of both hits."""
    if model.needs_new_rays:
        return lambda: model.trace_and_measure(scene, shown.pose, shown.others, shown.ego)

    def call() -> None:
        hits = tracer.trace(scene, shown.pose, shown.others)
        _describe(hits)
        model.measure(hits)

    return call


def _describe(hits: Hits) -> None:
    """Incidence on both hits, besides distance, material and instance."""
    hits.cos_incidence(hits.solid)
    hits.cos_incidence(hits.pane, hits.pane_beam)


def _beams_in_world(tracer: Tracer, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    direction = np.ascontiguousarray(tracer.rays.direction @ pose[:3, :3].T.astype(np.float32))
    return np.tile(pose[:3, 3].astype(np.float32), (len(direction), 1)), direction


def _raw_query(mesh: Mesh, tracer: Tracer, pose: np.ndarray) -> Callable[[], object]:
    scene, (origin, direction) = embree_scene(mesh), _beams_in_world(tracer, pose)
    return lambda: scene.run(origin, direction, np.full(len(origin), _FAR_M, np.float32), "INTERSECT", output=True)


def _open3d_s(mesh: Mesh, tracer: Tracer, pose: np.ndarray) -> float:
    """Time of the same query in Open3D; 0 where it is not installed."""
    if importlib.util.find_spec("open3d") is None:
        return 0.0
    open3d = importlib.import_module("open3d")

    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        open3d.core.Tensor(np.ascontiguousarray(mesh.vertices, np.float32)),
        open3d.core.Tensor(np.ascontiguousarray(mesh.faces, np.uint32)),
    )
    rays = open3d.core.Tensor(np.hstack(_beams_in_world(tracer, pose)))
    return best_s(lambda: scene.cast_rays(rays, nthreads=1), _REPEATS, time.perf_counter)
