"""Small analytic worlds for tests of ray tracing."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from sensors.scene import Instances


def plane(z_m: float = 0.0, half_m: float = 200.0, material: str = "asphalt", step_m: float = 10.0) -> Mesh:
    """A level square of ground around the origin."""
    ticks = np.arange(-half_m, half_m + step_m / 2, step_m)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Mesh.of(np.stack([x.ravel(), y.ravel(), np.full(x.size, z_m)], 1), faces, material)


def wall(x_m: float, material: str = "concrete", half_m: float = 50.0) -> Mesh:
    """A vertical square across the x axis."""
    corners = np.array([[x_m, -half_m, -half_m], [x_m, half_m, -half_m], [x_m, half_m, half_m], [x_m, -half_m, half_m]])
    return Mesh.of(corners, np.array([[0, 2, 1], [0, 3, 2]]), material)


def block(size: tuple[float, float, float], material: str = "car_paint") -> Mesh:
    """A box standing on the origin."""
    unit = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0, 1)])
    faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
    ]
    faces += [[1, 5, 7], [1, 7, 3]]
    return Mesh.of(unit * size, np.array(faces), material)


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> np.ndarray:
    """A (4, 4) pose turned about z."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    matrix[:3, 3] = x, y, z
    return matrix


def instances(poses: list[np.ndarray], model: str = "block", paint: float = 0.5) -> Instances:
    """Standing instances of one model."""
    n = len(poses)
    return Instances(
        ids=tuple(f"veh{i}" for i in range(n)),
        kinds=("car",) * n,
        models=(model,) * n,
        poses=np.array(poses, float).reshape(n, 4, 4),
        scales=np.ones((n, 3)),
        sizes=np.ones((n, 3)),
        velocity_mps=np.zeros((n, 3)),
        yaw_rate_radps=np.zeros(n),
        paint=np.full(n, paint, np.float32),
        rgb=np.full((n, 3), 0.5, np.float32),
    )
