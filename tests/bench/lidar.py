"""The LiDAR stage against one raw Embree query of the same beams on one merged static mesh."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from rich.table import Table

from assets import Mesh, build_model
from assets.world import build_world
from cosim.bridge import Bridge
from cosim.ground import Ground
from cosim.traffic import Traffic
from sensors.cameras.kitti_rig import lidar_pose_ego
from sensors.hits import Hits
from sensors.scene import Instances, Scene
from sensors.sensor_model import load_sensor
from sensors.tracing import Tracer
from sumo_nets import read_town

_FRAMES = 8
_REPEATS = 7


def table() -> Table:
    """Ratios over frames of town01."""
    sensor = load_sensor("hdl64e")
    tracer = Tracer(sensor.pattern.rays(), sensor.pattern.range_m)
    threads = os.cpu_count() or 1
    ratios, shared, raw_ms, near = [], [], [], []
    for scene, shared_scene, world_mesh, pose, instances in _frames(threads):
        merged = _merged(world_mesh, instances)
        origin = np.tile(pose[:3, 3].astype(np.float32), (len(tracer.rays), 1))
        direction = np.ascontiguousarray(tracer.rays.direction @ pose[:3, :3].T.astype(np.float32))

        def raw(merged: EmbreeScene = merged, origin: np.ndarray = origin, direction: np.ndarray = direction) -> None:
            merged.run(origin, direction, np.full(len(origin), 120, np.float32), "INTERSECT", output=True)

        def stage(scene: Scene = scene, pose: np.ndarray = pose, instances: Instances = instances) -> None:
            hits = tracer.trace(scene, pose, instances)
            _describe(hits)
            sensor.measure(hits)

        raw_s = _best(raw)
        ratios.append(_best(stage) / raw_s)
        shared.append(_best(partial(stage, shared_scene)) / raw_s)
        raw_ms.append(raw_s * 1e3)
        near.append(int((np.linalg.norm(instances.poses[:, :2, 3] - pose[:2, 3], axis=1) < 60).sum()))
    result = Table(title="LiDAR stage (both hits, normals, incidence, points) / one raw Embree query, merged mesh")
    for column in ("frame", "instances within 60 m", "raw query [ms]", "ratio, 1 thread", f"ratio, {threads} threads"):
        result.add_column(column, justify="right")
    for number, row in enumerate(zip(near, raw_ms, ratios, shared, strict=True)):
        result.add_row(str(number), str(row[0]), *(f"{value:.2f}" for value in row[1:]))
    result.add_section()
    result.add_row("median", "", *(f"{np.median(values):.2f}" for values in (raw_ms, ratios, shared)))
    return result


def _describe(hits: Hits) -> None:
    """What the stage promises of both hits besides distance, material and instance."""
    hits.cos_incidence(hits.solid)
    hits.cos_incidence(hits.pane, hits.pane_beam)


def _frames(threads: int) -> Iterator[tuple[Scene, Scene, Mesh, np.ndarray, Instances]]:
    town = read_town("town01")
    world = build_world(town.streets, 1)
    scene, shared = (Scene(world.mesh, build_model, count) for count in (1, threads))
    bridge = Bridge(Ground(world.ground), 1)
    rng = np.random.default_rng(1)
    with Traffic(town.sumocfg, seed=1) as traffic:
        ego = traffic.draw_ego(traffic.advance(600), rng)
        for _ in range(_FRAMES):
            traffic.prolong_route(ego, rng)
            actors = traffic.advance(50)
            placed = bridge.place(actors)
            row = actors.ids.index(ego)
            others = placed.take(np.delete(np.arange(len(placed)), row))
            yield scene, shared, world.mesh, placed.poses[row] @ lidar_pose_ego(), others


def _merged(world: Mesh, instances: Instances) -> EmbreeScene:
    """The world with all instances frozen into one static mesh."""
    models = {name: build_model(name) for name in set(instances.models)}
    placed = instances.poses.copy()
    placed[:, :3, :3] *= instances.scales[:, None, :]
    parts = [models[name].transformed(pose) for name, pose in zip(instances.models, placed, strict=True)]
    mesh = Mesh.merge([world, *parts])
    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, mesh.vertices, mesh.faces)
    return scene


def _best(call: Callable[[], None]) -> float:
    times = []
    for _ in range(_REPEATS):
        begun = time.perf_counter()
        call()
        times.append(time.perf_counter() - begun)
    return min(times)
