"""From rays and a posed scene to hits.

Instances are met first, in their own frames and only by the rays of their angular window; what they leave is
traced in the static world, each ray no farther than the instance that already stopped it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from assets.materials import material_column
from sensors.bvh import Bvh
from sensors.hits import NOTHING, RANGE_STEP_M, STATIC, Hits, Surface
from sensors.normals import encode_normals
from sensors.ray_index import RayIndex
from sensors.rays import Rays
from sensors.scene import Instances, Scene

_CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
_STEP_BEHIND_GLASS_M = 1e-3
_MOST_PANES = 16


class Tracer:
    """Traces one fixed set of rays, frame after frame.

    Args:
        rays: beams in LiDAR axes.
        range_m: nearest and farthest distance at which a surface counts [m].
    """

    def __init__(self, rays: Rays, range_m: tuple[float, float]) -> None:
        self.rays = rays
        self._near, self._far = range_m
        self._index = RayIndex(rays)
        self._is_glass = material_column("kind") == "glass"
        # Embree has no nearest distance: rays start that far out.
        self._start = rays.origin + rays.direction * np.float32(self._near)

    def trace(self, scene: Scene, pose: np.ndarray, instances: Instances) -> Hits:
        """First pane and first solid surface of every beam.

        Args:
            scene: what there is.
            pose: (4, 4) float64 world pose of the LiDAR.
            instances: what moves, at the same instant.
        """
        solid, pane = _Nearest(len(self.rays)), _Nearest(len(self.rays))
        for beams, row, glass, opaque in self._meet_instances(scene, pose, instances):
            solid.offer(beams, row, *opaque)
            pane.offer(beams, row, *glass)
        self._meet_static(scene.static, pose, solid, pane)
        pane_beam = np.flatnonzero(pane.distance < solid.distance).astype(np.int32)
        return Hits(
            rays=self.rays,
            pose=pose,
            solid=solid.surface(self._near),
            pane_beam=pane_beam,
            pane=pane.surface(self._near, pane_beam),
            paint=instances.paint,
        )

    def _meet_instances(self, scene: Scene, pose: np.ndarray, instances: Instances) -> Iterator[tuple]:
        """Per model: beams, instance rows, and (distance, packed normal code, material) of glass and of solid."""
        if not len(instances):
            return
        models = {name: scene.model(name) for name in sorted(set(instances.models))}
        bounds = np.stack([models[name].bounds for name in instances.models])
        # world-from-model with the scale folded in, then LiDAR-from-model and its inverse
        placed = instances.poses.copy()
        placed[:, :3, :3] *= instances.scales[:, None, :]
        lidar_from_model = np.linalg.inv(pose) @ placed
        model_from_lidar = np.linalg.inv(lidar_from_model)

        sensor = model_from_lidar[:, :3, 3]
        outside = np.maximum(np.maximum(bounds[:, 0] - sensor, sensor - bounds[:, 1]), 0)
        nearest = np.linalg.norm(outside * instances.scales, axis=1)
        reach = np.flatnonzero(nearest < self._far)
        if not len(reach):
            return
        corner = np.where(_CORNERS[None], bounds[reach, None, 1], bounds[reach, None, 0])
        corners = np.einsum("kij,kcj->kci", lidar_from_model[reach, :3, :3], corner)
        corners += lidar_from_model[reach, None, :3, 3]
        beams, box = self._index.window_pairs(corners, nearest[reach])
        row = reach[box].astype(np.int16)

        carry = model_from_lidar.astype(np.float32)
        names = np.array(instances.models)
        turn_normals = np.linalg.inv(placed[:, :3, :3]).transpose(0, 2, 1).astype(np.float32)
        for name, model in models.items():
            here = np.flatnonzero((names == name)[row])
            if not len(here):
                continue
            b, r = beams[here], row[here]
            matrix = carry[r]
            origin = np.einsum("nij,nj->ni", matrix[:, :3, :3], self._start[b]) + matrix[:, :3, 3]
            direction = np.einsum("nij,nj->ni", matrix[:, :3, :3], self.rays.direction[b])
            limit = np.full(len(b), self._far - self._near, np.float32)
            distance, triangle = model.opaque.first_hit(origin, direction, limit)
            pane_distance, pane_triangle = model.glass.first_hit(origin, direction, np.minimum(distance, limit))
            yield (
                b,
                r,
                _described(model.glass, pane_distance, pane_triangle, turn_normals, r),
                _described(model.opaque, distance, triangle, turn_normals, r),
            )

    def _meet_static(self, static: Bvh, pose: np.ndarray, solid: _Nearest, pane: _Nearest) -> None:
        if static.is_empty:
            return
        rotation = pose[:3, :3].astype(np.float32)
        direction = self.rays.direction @ rotation.T
        origin = self._start @ rotation.T + pose[:3, 3].astype(np.float32)
        limit = np.minimum(solid.distance, np.float32(self._far - self._near))
        distance, triangle = static.first_hit(origin, direction, limit)
        material = static.material[triangle]
        hit = triangle >= 0
        beams = np.flatnonzero(hit & self._is_glass[material]).astype(np.int32)
        panes = distance[beams]
        pane.offer_static(beams, panes, triangle[beams], static)
        hit[beams] = False
        solid.put_static(hit, distance, triangle, material, static)

        travelled = panes
        for _ in range(_MOST_PANES):
            if not len(beams):
                break
            travelled = travelled + np.float32(_STEP_BEHIND_GLASS_M)
            onward = direction[beams]
            step, triangle = static.first_hit(
                origin[beams] + onward * travelled[:, None], onward, limit[beams] - travelled
            )
            travelled = travelled + step
            hit = triangle >= 0
            glass = hit & self._is_glass[static.material[triangle]]
            done = hit & ~glass
            solid.offer_static(beams[done], travelled[done], triangle[done], static)
            beams, travelled = beams[glass], travelled[glass]


def _described(
    bvh: Bvh, distance: np.ndarray, triangle: np.ndarray, turn_normals: np.ndarray, row: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance, normal code in world axes and material of what was met; misses carry `inf`."""
    code = np.zeros(len(triangle), np.int32)
    material = np.zeros(len(triangle), np.uint8)
    hit = np.flatnonzero(triangle >= 0)
    if len(hit):
        normal = np.einsum("nij,nj->ni", turn_normals[row[hit]], bvh.normal[triangle[hit]])
        code[hit] = encode_normals(normal).view(np.int32)[:, 0]
        material[hit] = bvh.material[triangle[hit]]
    return distance, code, material


class _Nearest:
    """The nearest surface offered so far to each beam."""

    def __init__(self, beams: int) -> None:
        self.distance = np.full(beams, np.inf, np.float32)
        self._code = np.zeros(beams, np.int32)
        self._material = np.zeros(beams, np.uint8)
        self._instance = np.full(beams, NOTHING, np.int16)

    def offer(
        self, beams: np.ndarray, row: np.ndarray, distance: np.ndarray, code: np.ndarray, material: np.ndarray
    ) -> None:
        """Surfaces of instances; a beam may be offered several, misses carry `inf`."""
        better = np.flatnonzero(distance < self.distance[beams])
        # Of several offers to one beam the last assignment stands: the nearest.
        better = better[np.argsort(-distance[better], kind="stable")]
        rows = beams[better]
        self.distance[rows] = distance[better]
        self._code[rows] = code[better]
        self._material[rows] = material[better]
        self._instance[rows] = row[better]

    def offer_static(self, beams: np.ndarray, distance: np.ndarray, triangle: np.ndarray, static: Bvh) -> None:
        """Surfaces of the static world, at most one a beam."""
        nearer = distance < self.distance[beams]
        beams, distance, triangle = beams[nearer], distance[nearer], triangle[nearer]
        self.distance[beams] = distance
        self._code[beams] = static.packed_normal[triangle]
        self._material[beams] = static.material[triangle]
        self._instance[beams] = STATIC

    def put_static(
        self, hit: np.ndarray, distance: np.ndarray, triangle: np.ndarray, material: np.ndarray, static: Bvh
    ) -> None:
        """Surfaces of the static world for all beams where `hit`, known to be nearer than what was offered."""
        self.distance = np.where(hit, distance, self.distance)
        self._code = np.where(hit, static.packed_normal[triangle], self._code)
        self._material = np.where(hit, material, self._material)
        self._instance = np.where(hit, np.int16(STATIC), self._instance)

    def surface(self, offset_m: float, beams: np.ndarray | slice = slice(None)) -> Surface:
        """The surfaces of `beams`, ranges counted from the optical centre and rounded to the stored step."""
        steps = np.rint((self.distance[beams] + np.float32(offset_m)) / np.float32(RANGE_STEP_M))
        return Surface(
            range_m=(steps * np.float32(RANGE_STEP_M)).astype(np.float32),
            normal_code=self._code[beams].view(np.int16).reshape(-1, 2),
            material=self._material[beams],
            instance=self._instance[beams],
        )
