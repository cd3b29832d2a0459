"""From rays and a posed scene to hits.

The static world is met first. Instances are then met in their own frames, all of one model in one query, each only
by the rays of its angular window and no farther than what already stopped them.
"""

from __future__ import annotations

import itertools

import numpy as np

from sensors.hit_buffer import HitBuffer
from sensors.hits import Hits
from sensors.intersection import meet_static
from sensors.ray_index import RayIndex
from sensors.rays import Rays
from sensors.scene import Instances, Scene

_CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])


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

    def trace(self, scene: Scene, pose: np.ndarray, instances: Instances, *, panes: bool = True) -> Hits:
        """First pane and first solid surface of every beam.

        Args:
            scene: what there is.
            pose: (4, 4) float64 world pose of the LiDAR.
            instances: what moves, at the same instant.
            panes: whether the panes of instances are included; without them their glass is ignored.
        """
        matrix = pose.astype(np.float32)
        limit = np.full(len(self.rays), self._far, np.float32)
        direction = self.rays.direction @ matrix[:3, :3].T
        solid, pane = meet_static(scene.static, self._centres(matrix), direction, limit, self._near)
        if len(instances):
            self._meet_instances(scene, pose, instances, solid, pane, panes=panes)
        pane_beam = np.flatnonzero(pane.distance < solid.distance).astype(np.int32)
        return Hits(
            rays=self.rays,
            pose=pose,
            solid=solid.surface(),
            pane_beam=pane_beam,
            pane=pane.surface(pane_beam),
            paint=instances.paint,
            table=scene.table,
            carried=direction,
        )

    def _meet_instances(
        self, scene: Scene, pose: np.ndarray, instances: Instances, solid: HitBuffer, pane: HitBuffer, *, panes: bool
    ) -> None:
        models = {name: scene.model(name) for name in dict.fromkeys(instances.models)}
        number = {name: position for position, name in enumerate(models)}
        bounds = np.stack([model.bounds for model in models.values()])[[number[name] for name in instances.models]]
        placed = instances.poses.copy()  # world from model, with the scale folded in
        placed[:, :3, :3] *= instances.scales[:, None, :]
        lidar_from_model = np.linalg.inv(pose) @ placed
        unturned = np.linalg.inv(placed[:, :3, :3])
        sensor = np.einsum("kij,kj->ki", unturned, pose[:3, 3] - placed[:, :3, 3])
        outside = np.maximum(np.maximum(bounds[:, 0] - sensor, sensor - bounds[:, 1]), 0)
        nearest = np.linalg.norm(outside * instances.scales, axis=1)
        reach = _by_model(instances.models, nearest, np.flatnonzero(nearest < self._far))
        corner = np.where(_CORNERS[None], bounds[reach, None, 1], bounds[reach, None, 0])
        corners = np.einsum("kij,kcj->kci", lidar_from_model[reach, :3, :3], corner)
        corners += lidar_from_model[reach, None, :3, 3]
        pairs, box = self._index.window_pairs(corners, nearest[reach])

        near = nearest[reach].astype(np.float32)
        open_way = np.flatnonzero(solid.distance[pairs] > near[box])
        pairs, box = pairs[open_way], box[open_way]
        ends = np.searchsorted(box, np.arange(len(reach) + 1))
        direction = self.rays.direction.take(pairs, axis=0)
        origin = self._carry(unturned[reach] @ pose[:3, :3], sensor[reach], pairs, direction, ends)
        names = [instances.models[row] for row in reach]
        for name, group in itertools.groupby(range(len(reach)), key=names.__getitem__):
            boxes = list(group)
            first, last = int(ends[boxes[0]]), int(ends[boxes[-1] + 1])
            if first == last:
                continue
            model = models[name]
            outer = model.whole if panes else model.opaque
            beams, rows = pairs[first:last], reach[box[first:last]]
            start, onward = origin[first:last], direction[first:last]
            limit = solid.distance[beams]
            distance, triangle = outer.first_hit(start, onward, limit, self._near)
            hit = np.flatnonzero(triangle >= 0)
            if not len(hit):
                continue
            beams, distance, triangle, rows = beams[hit], distance[hit], triangle[hit], rows[hit]
            records, normals = outer.records[triangle], outer.normal.take(triangle, axis=0)
            glass = np.flatnonzero(outer.is_glass[triangle])
            if len(glass):
                pane.offer_instance(
                    beams[glass], distance[glass], records[glass], normals.take(glass, axis=0), rows[glass]
                )
                behind = hit[glass]
                step, inner = model.opaque.first_hit(
                    start.take(behind, axis=0), onward.take(behind, axis=0), limit[behind], self._near
                )
                distance[glass] = np.inf
                met = np.flatnonzero(inner >= 0)
                glass, inner = glass[met], inner[met]
                distance[glass], records[glass] = step[met], model.opaque.records[inner]
                normals[glass] = model.opaque.normal.take(inner, axis=0)
            solid.offer_instance(beams, distance, records, normals, rows)
        solid.settle(unturned.astype(np.float32))
        pane.settle(unturned.astype(np.float32))

    def _carry(
        self, turns: np.ndarray, centres: np.ndarray, pairs: np.ndarray, direction: np.ndarray, ends: np.ndarray
    ) -> np.ndarray:
        """Carry the directions of pairs (p, 3) into their boxes' frames, in place; gives the origins there, (p, 3).

        Args:
            turns: (k, 3, 3) from the sensor's axes into the boxes'.
            centres: (k, 3) where the sensor's origin is in them.
            pairs: (p,) rows of the rays, sorted by box.
            direction: (p, 3) float32 of those rays.
            ends: (k + 1,) start of the pairs of each box, and the last end.
        """
        turns = turns.astype(np.float32)
        origin = np.repeat(centres.astype(np.float32), np.diff(ends), axis=0)
        for turn, (start, stop) in zip(turns, itertools.pairwise(ends.tolist()), strict=True):
            direction[start:stop] = direction[start:stop] @ turn.T
            if not self.rays.one_centre:
                origin[start:stop] += self.rays.origin.take(pairs[start:stop], axis=0) @ turn.T
        return origin

    def _centres(self, matrix: np.ndarray) -> np.ndarray:
        """Optical centres of all beams carried by a (4, 4) float32 matrix, (n, 3)."""
        if self.rays.one_centre:
            return np.repeat(matrix[None, :3, 3], len(self.rays), axis=0)
        return self.rays.origin @ matrix[:3, :3].T + matrix[:3, 3]


def _by_model(models: tuple[str, ...], nearest: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows with those of one model together: one query serves them all. The nearest models come first."""
    by_distance = rows[np.argsort(nearest[rows], kind="stable")]
    rank = {name: position for position, name in enumerate(dict.fromkeys(models[row] for row in by_distance))}
    return by_distance[np.argsort([rank[models[row]] for row in by_distance], kind="stable")]
