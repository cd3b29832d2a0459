"""From rays and a posed scene to hits.

The static world is met first. Instances are then met in their own frames, the nearest first, each only by the
rays of its angular window and no farther than what already stopped them.
"""

from __future__ import annotations

import numpy as np

from sensors.hits import Hits
from sensors.meeting import meet_static
from sensors.nearest import Nearest
from sensors.ray_index import RayIndex
from sensors.rays import Rays
from sensors.scene import Instances, Scene

_CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
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

    def trace(self, scene: Scene, pose: np.ndarray, instances: Instances) -> Hits:
        """First pane and first solid surface of every beam.

        Args:
            scene: what there is.
            pose: (4, 4) float64 world pose of the LiDAR.
            instances: what moves, at the same instant.
        """
        matrix = pose.astype(np.float32)
        limit = np.full(len(self.rays), self._far, np.float32)
        direction = self.rays.direction @ matrix[:3, :3].T
        solid, pane = meet_static(scene.static, self._centres(matrix), direction, limit, self._near)
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
            table=scene.table,
        )

    def _meet_instances(
        self, scene: Scene, pose: np.ndarray, instances: Instances, solid: Nearest, pane: Nearest
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
            distance, triangle = model.whole.first_hit(origin, direction, limit, self._near)
            hit = np.flatnonzero(triangle >= 0)
            if not len(hit):
                continue
            beams, distance, triangle = beams[hit], distance[hit], triangle[hit]
            normals = model.whole.normal[triangle] @ turn
            glass = np.flatnonzero(model.whole.is_glass[triangle])
            if len(glass):
                panes, behind = beams[glass], hit[glass]
                pane.offer_instance(panes, distance[glass], model.whole.records[triangle[glass]], normals[glass], row)
                distance[glass] = np.inf
                step, inner = model.opaque.first_hit(origin[behind], direction[behind], limit[behind], self._near)
                met = np.flatnonzero(inner >= 0)
                inner = inner[met]
                inner_normals = model.opaque.normal[inner] @ turn
                solid.offer_instance(panes[met], step[met], model.opaque.records[inner], inner_normals, row)
            solid.offer_instance(beams, distance, model.whole.records[triangle], normals, row)
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
