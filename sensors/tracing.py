"""From rays and a posed scene to hits.

The static world is met first. Instances are then met in their own frames, the nearest first, each only by the
rays of its angular window and no farther than what already stopped them.
"""

from __future__ import annotations

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
_WORTH_CULLING = 200  # beams; testing fewer against a box costs more than tracing them


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

    def trace(self, scene: Scene, pose: np.ndarray, instances: Instances) -> Hits:
        """First pane and first solid surface of every beam.

        Args:
            scene: what there is.
            pose: (4, 4) float64 world pose of the LiDAR.
            instances: what moves, at the same instant.
        """
        solid, pane = self._meet_static(scene.static, pose)
        if len(instances):
            self._meet_instances(scene, pose, instances, solid, pane)
        pane_beam = np.flatnonzero(pane.distance < solid.distance).astype(np.int32)
        return Hits(
            rays=self.rays,
            pose=pose,
            solid=solid.surface(),
            pane_beam=pane_beam,
            pane=pane.surface(pane_beam),
            paint=instances.paint,
        )

    def _meet_static(self, static: Bvh, pose: np.ndarray) -> tuple[_Nearest, _Nearest]:
        limit = np.full(len(self.rays), self._far, np.float32)
        if static.is_empty:
            return _Nearest.nothing(limit), _Nearest.nothing(limit)
        matrix = pose.astype(np.float32)
        direction = self.rays.direction @ matrix[:3, :3].T
        origin = self._centres(matrix)
        distance, triangle = self._first_hit(static, origin, direction, limit)
        material = static.material[triangle]
        behind = np.flatnonzero(self._is_glass[material] & (triangle >= 0))
        travelled, panes = distance[behind], triangle[behind]
        distance[behind], triangle[behind] = limit[behind], -1
        solid, pane = _Nearest.of_static(static, distance, triangle, material), _Nearest.nothing(limit)
        pane.put_static(behind, travelled, panes, static)

        for _ in range(_MOST_PANES):
            if not len(behind):
                break
            travelled = travelled + np.float32(_STEP_BEHIND_GLASS_M)
            onward = direction[behind]
            start = origin[behind] + onward * travelled[:, None]
            step, triangle = static.first_hit(start, onward, limit[behind] - travelled)
            travelled = travelled + step
            glass = (triangle >= 0) & static.is_glass[triangle]
            done = (triangle >= 0) & ~glass
            solid.put_static(behind[done], travelled[done], triangle[done], static)
            behind, travelled = behind[glass], travelled[glass]
        return solid, pane

    def _meet_instances(
        self, scene: Scene, pose: np.ndarray, instances: Instances, solid: _Nearest, pane: _Nearest
    ) -> None:
        models = {name: scene.model(name) for name in sorted(set(instances.models))}
        bounds = np.stack([models[name].bounds for name in instances.models])
        placed = instances.poses.copy()  # world from model, with the scale folded in
        placed[:, :3, :3] *= instances.scales[:, None, :]
        lidar_from_model = np.linalg.inv(pose) @ placed
        model_from_lidar = np.linalg.inv(lidar_from_model)
        turn_normals = np.linalg.inv(placed[:, :3, :3]).astype(np.float32)

        sensor = model_from_lidar[:, :3, 3]
        outside = np.maximum(np.maximum(bounds[:, 0] - sensor, sensor - bounds[:, 1]), 0)
        nearest = np.linalg.norm(outside * instances.scales, axis=1)
        reach = np.flatnonzero(nearest < self._far)
        reach = reach[np.argsort(nearest[reach], kind="stable")]
        corner = np.where(_CORNERS[None], bounds[reach, None, 1], bounds[reach, None, 0])
        corners = np.einsum("kij,kcj->kci", lidar_from_model[reach, :3, :3], corner)
        corners += lidar_from_model[reach, None, :3, 3]
        pairs, box = self._index.window_pairs(corners, nearest[reach])

        open_way = solid.distance[pairs] > nearest[reach].astype(np.float32)[box]
        pairs, box = pairs[open_way], box[open_way]
        directions = self.rays.direction.take(pairs, axis=0)
        carry = model_from_lidar.astype(np.float32)
        ends = np.searchsorted(box, np.arange(len(reach) + 1)).tolist()
        for number, row in enumerate(reach.tolist()):
            window = slice(ends[number], ends[number + 1])
            if window.start == window.stop:
                continue
            model, matrix, turn = models[instances.models[row]], carry[row], turn_normals[row]
            beams, direction = pairs[window], directions[window] @ matrix[:3, :3].T
            origin = self._centres(matrix, beams)
            if len(beams) > _WORTH_CULLING:
                kept = np.flatnonzero(_meets_box(origin, direction, model.bounds.astype(np.float32)))
                beams, direction, origin = beams[kept], direction[kept], origin[kept]
            limit = solid.distance[beams]
            distance, triangle = self._first_hit(model.whole, origin, direction, limit)
            hit = np.flatnonzero(triangle >= 0)
            if not len(hit):
                continue
            beams, distance, triangle = beams[hit], distance[hit], triangle[hit]
            glass = np.flatnonzero(model.whole.is_glass[triangle])
            if len(glass):
                pane.put_instance(beams[glass], distance[glass], triangle[glass], model.whole, turn, row)
                behind = hit[glass]
                limit = limit[behind]
                step, inner = self._first_hit(model.opaque, origin[behind], direction[behind], limit)
                solid.put_instance(beams[glass], np.where(inner >= 0, step, np.inf), inner, model.opaque, turn, row)
                distance[glass] = np.inf
            solid.put_instance(beams, distance, triangle, model.whole, turn, row)
        solid.settle()
        pane.settle()

    def _centres(self, matrix: np.ndarray, beams: np.ndarray | None = None) -> np.ndarray:
        """Optical centres of some beams (all if None) carried by a (4, 4) float32 matrix, (k, 3)."""
        if self.rays.one_centre:
            centres = np.empty((len(self.rays if beams is None else beams), 3), np.float32)
            centres[:] = matrix[:3, 3]
            return centres
        origin = self.rays.origin if beams is None else self.rays.origin[beams]
        return origin @ matrix[:3, :3].T + matrix[:3, 3]

    def _first_hit(
        self, bvh: Bvh, origin: np.ndarray, direction: np.ndarray, limit: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Nearest hit from the nearest range on, which Embree itself does not know."""
        distance, triangle = bvh.first_hit(origin, direction, limit)
        close = np.flatnonzero(distance < self._near)
        if len(close):
            start, onward = origin[close] + direction[close] * np.float32(self._near), direction[close]
            step, triangle[close] = bvh.first_hit(start, onward, limit[close] - np.float32(self._near))
            distance[close] = step + np.float32(self._near)
        return distance, triangle


def _meets_box(origin: np.ndarray, direction: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Whether rays (n) meet an axis-aligned box (2, 3): the slab test (Kay and Kajiya, SIGGRAPH 1986)."""
    enter, leave = np.zeros(len(direction), np.float32), np.full(len(direction), np.inf, np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis in range(3):
            inverse = 1 / direction[:, axis]
            low = (bounds[0, axis] - origin[:, axis]) * inverse
            high = (bounds[1, axis] - origin[:, axis]) * inverse
            # fmax and fmin pass over the NaN of a ray within a face's plane: it may meet.
            enter = np.fmax(enter, np.minimum(low, high))
            leave = np.fmin(leave, np.maximum(low, high))
    return leave >= enter


class _Nearest:
    """The nearest surface met so far by each beam.

    Attributes:
        distance: (n,) float32, the farthest that counts where there is none.
        code: (n,) int32 packed normal codes, world axes.
        material: (n,) uint8.
        instance: (n,) int16.
    """

    def __init__(self, distance: np.ndarray, code: np.ndarray, material: np.ndarray, instance: np.ndarray) -> None:
        self.distance, self.code, self.material, self.instance = distance, code, material, instance
        self._normals: list[tuple[np.ndarray, np.ndarray]] = []

    @classmethod
    def nothing(cls, limit: np.ndarray) -> _Nearest:
        """No surfaces within the limits (n,)."""
        beams = len(limit)
        return cls(
            limit.copy(), np.zeros(beams, np.int32), np.zeros(beams, np.uint8), np.full(beams, NOTHING, np.int16)
        )

    @classmethod
    def of_static(cls, static: Bvh, distance: np.ndarray, triangle: np.ndarray, material: np.ndarray) -> _Nearest:
        """What a query of all beams met in the static world."""
        instance = np.where(triangle >= 0, np.int16(STATIC), np.int16(NOTHING))
        return cls(distance, static.packed_normal[triangle], material, instance)

    def put_static(self, beams: np.ndarray, distance: np.ndarray, triangle: np.ndarray, static: Bvh) -> None:
        """Surfaces of the static world, for beams that met none so far."""
        self.distance[beams] = distance
        self.code[beams] = static.packed_normal[triangle]
        self.material[beams] = static.material[triangle]
        self.instance[beams] = STATIC

    def put_instance(
        self, beams: np.ndarray, distance: np.ndarray, triangle: np.ndarray, bvh: Bvh, turn: np.ndarray, row: int
    ) -> None:
        """Surfaces of one instance where they are nearer; normals times `turn` are in world axes."""
        hit = np.flatnonzero(distance < self.distance[beams])
        beams, triangle = beams[hit], triangle[hit]
        self.distance[beams] = distance[hit]
        self.material[beams] = bvh.material[triangle]
        self.instance[beams] = row
        self._normals.append((beams, bvh.normal[triangle] @ turn))

    def settle(self) -> None:
        """Encode the normals of instances, all at once; of several for one beam the last is the nearest."""
        if self._normals:
            beams, normals = (np.concatenate(column) for column in zip(*self._normals, strict=True))
            self.code[beams] = encode_normals(normals).view(np.int32)[:, 0]
            self._normals.clear()

    def surface(self, beams: np.ndarray | slice = slice(None)) -> Surface:
        """The surfaces of `beams`, ranges rounded to the stored step."""
        instance = self.instance[beams]
        steps = np.rint(self.distance[beams] / np.float32(RANGE_STEP_M))
        steps *= np.float32(RANGE_STEP_M)
        steps[instance == NOTHING] = np.inf
        return Surface(
            range_m=steps,
            normal_code=self.code[beams].view(np.int16).reshape(-1, 2),
            material=self.material[beams],
            instance=instance,
        )
