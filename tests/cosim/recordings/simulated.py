"""Recordings traced in a yard of boxes, for what needs real geometry and no traffic."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from assets.mesh import Mesh
from cosim.drives.twin.scene import scene_instances
from cosim.recordings import Scan
from cosim.recordings.mapping.motion import motions
from sensors.pattern import Pattern
from sensors.rays import Rays
from sensors.scene import Scene
from sensors.tracing import Tracer

HEIGHT_M = 1.8
SCANS, STEP_M, TURN_RAD = 14, 0.5, 0.01  # of a drive, and the way between two scans
_CURVE_M, _CLEAR_M = 50.0, 7.0  # radius of a drive through the yard that turns to the left, and room about it


@cache
def yard() -> Scene:
    """Level ground, and up to sixty boxes of three to forty metres about the origin, none in the way of a drive."""
    rng = np.random.default_rng(0)
    ground = trimesh.creation.box((400, 400, 0.1)).subdivide().subdivide().subdivide().subdivide()
    ground.apply_translation((0, 0, -HEIGHT_M - 0.05))
    shapes = [ground]
    for _ in range(60):
        angle, away, tall = rng.uniform(-np.pi, np.pi), rng.uniform(8, 60), rng.uniform(3, 40)
        box = trimesh.creation.box((rng.uniform(2, 9), rng.uniform(2, 9), tall))
        x, y = away * np.cos(angle), away * np.sin(angle)
        box.apply_translation((x, y, tall / 2 - HEIGHT_M))
        if x < 0 or abs(np.hypot(x, y - _CURVE_M) - _CURVE_M) > _CLEAR_M:
            shapes.append(box)
    parts = [Mesh.of(np.asarray(shape.vertices), np.asarray(shape.faces), "asphalt") for shape in shapes]
    return Scene(Mesh.merge(parts), lambda name: parts[0])


def scans(pattern: Pattern, order: str, count: int = 4, noise_m: float = 0.02, seed: int = 0) -> list[Scan]:
    """Scans from places in the yard, in metres and float32; a tenth of the returns is lost.

    Args:
        pattern: of the beams.
        order: `rings`, `firings` or `shuffled`.
        count: of scans.
        noise_m: standard deviation of ranges.
        seed: of places, noise and losses.
    """
    rng = np.random.default_rng(seed)
    rays = pattern.rays()
    tracer, found = Tracer(rays, pattern.range_m), []
    for number in range(count):
        pose, turn = np.eye(4), rng.uniform(-3, 3)
        pose[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        pose[:2, 3] = rng.uniform(-4, 4, 2)
        reach = tracer.trace(yard(), pose, scene_instances(())).solid.range_m.astype(np.float64)
        rows = np.flatnonzero((reach < pattern.range_m[1]) & (rng.random(len(reach)) < 0.9))
        if order == "firings":
            rows = rows[np.lexsort((rays.ring[rows], rays.time_s[rows]))]
        elif order == "shuffled":
            rows = rng.permutation(rows)
        away = reach[rows] + rng.normal(0, noise_m, len(rows))
        xyz = (rays.direction[rows].astype(np.float64) * away[:, None]).astype(np.float32)
        found.append(Scan(f"{number:06d}", xyz.astype(np.float64)))
    return found


def path(count: int = SCANS) -> np.ndarray:
    """Poses (n, 4, 4) of a sensor that drives ahead and turns a little."""
    step = np.eye(4)
    step[:2, :2] = [[np.cos(TURN_RAD), -np.sin(TURN_RAD)], [np.sin(TURN_RAD), np.cos(TURN_RAD)]]
    step[0, 3] = STEP_M
    poses = [np.eye(4)]
    for _ in range(count - 1):
        poses.append(poses[-1] @ step)
    return np.array(poses)


def carried(pattern: Pattern) -> Rays:
    """The beams of a revolution as the moving sensor sends them, in its axes at the pose time."""
    rays, motion = pattern.rays(), motions(path())[0]
    share = rays.time_s.astype(float)[:, None] / pattern.sweep_s
    turned = Rotation.from_rotvec(share * motion[:3]).apply(rays.direction.astype(float))
    return replace(rays, origin=(share * motion[3:]).astype(np.float32), direction=turned.astype(np.float32))


def record(folder: Path, poses: np.ndarray, pattern: Pattern) -> Path:
    """Scans of the yard on the way, each beam from where the sensor is at its time, with 2 cm of noise."""
    folder.mkdir(parents=True)
    rng, rays = np.random.default_rng(0), pattern.rays()
    tracer = Tracer(carried(pattern), pattern.range_m)
    for number, pose in enumerate(poses):
        reach = tracer.trace(yard(), pose, scene_instances(())).solid.range_m.astype(float)
        rows = np.flatnonzero(reach < pattern.range_m[1])
        away = reach[rows] + rng.normal(0, 0.02, len(rows))
        xyz = rays.direction[rows].astype(float) * away[:, None]
        np.column_stack([xyz, np.full(len(rows), 0.3)]).astype("<f4").tofile(folder / f"{number:06d}.bin")
    return folder
