"""Casts rays at a twin: one Embree scene for the static world, one a model, nothing built twice."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from tests.hidden.twin_files import MaterialTable, Soup, read_soup

STATIC, NOTHING = -1, -2
_LONGEST_M = 40.0  # of anything that moves, its way during a sweep included


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What n rays meet.

    Attributes:
        distance: (n,) float32 [m], inf where nothing is met.
        cos: (n,) float32, cosine of incidence 0–1.
        normal: (n, 3) float32 in world axes, against the ray.
        material: (n,) int16 rows of the table, −1 for nothing.
        instance: (n,) int16 rows of the frame's list, −1 static, −2 nothing.
    """

    distance: np.ndarray
    cos: np.ndarray
    normal: np.ndarray
    material: np.ndarray
    instance: np.ndarray


class _Shape:
    """One kind of surface (solid or glass) of one mesh."""

    def __init__(self, soup: Soup) -> None:
        self.material = soup.material
        edge = soup.corners[:, 1:] - soup.corners[:, :1]
        self.normal = np.cross(edge[:, 0], edge[:, 1])
        self._scene = EmbreeScene(robust=True) if len(soup.corners) else None
        if self._scene is not None:
            TriangleMesh(self._scene, soup.corners)

    def first(self, origin: np.ndarray, direction: np.ndarray, far: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance and triangle, −1 for a miss."""
        if self._scene is None or not len(origin):
            return far, np.full(len(origin), -1)
        found = self._scene.run(
            np.ascontiguousarray(origin, np.float32),
            np.ascontiguousarray(direction, np.float32),
            far.astype(np.float32),
            "INTERSECT",
            output=True,
        )
        return found["tfar"], found["primID"]


class _Model:
    """A mesh split into surfaces that stop a beam and surfaces that transmit it."""

    def __init__(self, soup: Soup, glass: np.ndarray) -> None:
        is_glass = glass[soup.material]
        self.solid, self.pane = _Shape(soup.part(~is_glass)), _Shape(soup.part(is_glass))
        low, high = soup.corners.reshape(-1, 3).min(0), soup.corners.reshape(-1, 3).max(0)
        self.centre = (low + high) / 2
        self.radius = float(np.linalg.norm(high - low) / 2)


class Twin:
    """The world of a drive, ready for rays.

    Args:
        folder: the drive's `twin/`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.table = MaterialTable(folder / "materials.yaml")
        self._statics: dict[str, _Model] = {}
        self._models: dict[str, _Model] = {}

    def cast(
        self,
        frame: dict,
        origin: np.ndarray,
        direction: np.ndarray,
        after: np.ndarray | float,
        reach: tuple[float, float],
    ) -> tuple[Surfaces, Surfaces]:
        """First solid surface and first pane of glass along rays, of those within reach.

        Args:
            frame: the frame's JSON.
            origin: (n, 3) in world axes, or (3,) for all.
            direction: (n, 3) unit vectors.
            after: (n,) or one time since the pose time [s], at which a ray meets the moving world.
            reach: nearest and farthest distance [m].
        """
        origin, (near, far) = np.broadcast_to(origin, direction.shape), reach
        found = self._first(frame, origin, direction, np.asarray(after, float), far)
        for surfaces in found:
            rows = np.flatnonzero(surfaces.distance < near)
            if len(rows):  # look again from the start of the reach
                start = origin[rows] + near * direction[rows]
                time = np.broadcast_to(after, len(direction))[rows]
                further = self._first(frame, start, direction[rows], time, far - near)[surfaces is found[1]]
                further.distance[:] += np.float32(near)
                for name in ("distance", "cos", "normal", "material", "instance"):
                    getattr(surfaces, name)[rows] = getattr(further, name)
        return found

    def _first(
        self, frame: dict, origin: np.ndarray, direction: np.ndarray, after: np.ndarray, far: float
    ) -> tuple[Surfaces, Surfaces]:
        n = len(direction)
        direction32 = direction.astype(np.float32)
        solid, pane = _Nearest(n, far), _Nearest(n, far)
        world = self._static(frame)
        everything, low, high = np.arange(n), origin.min(0), origin.max(0)
        for near, shape in ((solid, world.solid), (pane, world.pane)):
            near.offer(shape, everything, origin, direction32, None, STATIC)
        for row, thing in enumerate(frame["instances"]):
            position = np.array(thing["pose"])[:3, 3]
            if np.linalg.norm(position - np.clip(position, low, high)) > far + _LONGEST_M:
                continue
            model = self._model(thing["model"])
            rays, local_origin, local_direction, normals = _to_model(
                thing, model, origin, direction32, after, np.float32(far)
            )
            if len(rays):
                for near, shape in ((solid, model.solid), (pane, model.pane)):
                    near.offer(shape, rays, local_origin, local_direction, normals, row)
        return solid.surfaces(direction32), pane.surfaces(direction32)

    def _static(self, frame: dict) -> _Model:
        name = frame.get("static") or "static.glb"
        if name not in self._statics:
            self._statics[name] = _Model(read_soup(self.folder / name, self.table), self.table.glass)
        return self._statics[name]

    def _model(self, name: str) -> _Model:
        if name not in self._models:
            soup = read_soup(self.folder / "models" / f"{name}.glb", self.table)
            self._models[name] = _Model(soup, self.table.glass)
        return self._models[name]


class _Nearest:
    """The nearest of what is offered, ray by ray."""

    def __init__(self, n: int, far: float) -> None:
        self._far = far
        self._distance = np.full(n, far, np.float32)
        self._normal = np.zeros((n, 3), np.float32)
        self._material = np.full(n, -1, np.int16)
        self._instance = np.full(n, NOTHING, np.int16)

    def offer(self, shape: _Shape, rays, origin, direction, turn, instance: int) -> None:
        distance, triangle = shape.first(origin, direction, self._distance[rays])
        hit = triangle >= 0
        rays, triangle = rays[hit], triangle[hit]
        normal = shape.normal[triangle]
        if turn is not None:
            normal = np.einsum("...ij,...j->...i", turn if turn.ndim == 2 else turn[hit], normal)
        self._distance[rays], self._normal[rays] = distance[hit], normal
        self._material[rays], self._instance[rays] = shape.material[triangle], instance

    def surfaces(self, direction: np.ndarray) -> Surfaces:
        met = self._instance != NOTHING
        normal = self._normal / np.maximum(np.linalg.norm(self._normal, axis=1, keepdims=True), 1e-30)
        along = np.einsum("ij,ij->i", normal, direction)
        normal = np.where(along[:, None] > 0, -normal, normal)
        distance = np.where(met, self._distance, np.inf).astype(np.float32)
        return Surfaces(distance, np.abs(along), normal, self._material, self._instance)


def _to_model(thing: dict, model: _Model, origin, direction, after, far):
    """Rays that pass a model's bounding sphere, in its own axes, and what turns its normals back into the world."""
    pose, scale = np.array(thing["pose"], float), np.array(thing["scale"], float)
    velocity, rate = np.array(thing["velocity_mps"], float), float(thing["yaw_rate_radps"])
    still = not after.any() or (not velocity.any() and rate == 0)
    centre = pose[:3, :3] @ (model.centre * scale) + pose[:3, 3]
    radius = model.radius * scale.max() + 0.05 + abs(rate) * np.abs(after).max() * np.linalg.norm(centre - pose[:3, 3])
    towards = centre - origin[:1] if origin.strides[0] == 0 else centre - origin
    if not still:
        towards = towards + after[..., None] * velocity
    towards = towards.astype(np.float32)
    if len(towards) == 1:
        along, square = direction @ towards[0], float(towards[0] @ towards[0])
        if square > (far + radius) ** 2:
            return np.empty(0, int), None, None, None
    else:
        along, square = np.einsum("ij,ij->i", direction, towards), np.einsum("ij,ij->i", towards, towards)
    ahead = np.maximum(along, 0)  # who starts inside the sphere meets it looking away from its middle, too
    near = (square - ahead**2 < radius**2) & (along < far + radius)
    rays = np.flatnonzero(near)
    start, heading = origin[rays] - pose[:3, 3], direction[rays].astype(float)
    turn = pose[:3, :3]
    if not still:
        time = np.broadcast_to(after, near.shape)[rays]
        start = start - time[:, None] * velocity
        c, s = np.cos(rate * time), np.sin(rate * time)
        zero, one = np.zeros_like(c), np.ones_like(c)
        spin = np.stack([c, -s, zero, s, c, zero, zero, zero, one], -1).reshape(-1, 3, 3)
        turn = spin @ turn
    back = np.swapaxes(turn, -1, -2)
    start = np.einsum("...ij,...j->...i", back, start) / scale
    heading = np.einsum("...ij,...j->...i", back, heading) / scale
    return rays, start.astype(np.float32), heading.astype(np.float32), (turn / scale).astype(np.float32)
