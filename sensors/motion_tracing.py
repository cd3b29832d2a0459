"""Tracing while everything moves: each ray at its own instant, carried into each instance's frame at that instant."""

from __future__ import annotations

import numpy as np

from sensors.bvh import Bvh
from sensors.hits import NOTHING, RANGE_STEP_M, STATIC, Hits, Surface
from sensors.motion import EgoMotion, moved_poses
from sensors.normals import encode_normals
from sensors.ray_index import RayIndex
from sensors.rays import Rays
from sensors.scene import Instances, Scene

_CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
_INSTANTS = 5
_WINDOW_MARGIN_M = 0.03  # covers the bow of a turning box's path between two instants
_STEP_BEHIND_GLASS_M = 1e-3
_MOST_PANES = 16


class MotionTracer:
    """Traces one fixed fan of rays that leave one by one from a moving sensor.

    Args:
        rays: beams in the sensor's own axes.
        range_m: nearest and farthest distance at which a surface counts [m].
    """

    def __init__(self, rays: Rays, range_m: tuple[float, float]) -> None:
        self.rays = rays
        self._near, self._far = range_m
        self._index = RayIndex(rays)

    def trace(
        self, scene: Scene, ego: EgoMotion, lidar_in_ego: np.ndarray, time_s: np.ndarray, instances: Instances
    ) -> tuple[Hits, np.ndarray, np.ndarray]:
        """First pane and first solid surface of every beam.

        Args:
            scene: what there is.
            ego: the vehicle at the pose time, and its motion.
            lidar_in_ego: (4, 4) pose of the sensor in the vehicle.
            time_s: (n,) float32 instant of each ray from the pose time.
            instances: what moves, at the pose time.

        Returns:
            Hits; true optical centres from the sensor's place at the pose time, and directions, (n, 3) float32 in
            world axes.
        """
        origin, direction = _carried_rays(self.rays, ego, lidar_in_ego, time_s)
        # Around the sensor, so that float32 keeps its digits.
        centre = (ego.pose @ lidar_in_ego)[:3, 3]
        start = origin + direction * np.float32(self._near)
        reach = np.float32(self._far - self._near)
        solid, pane = Nearest(len(self.rays)), Nearest(len(self.rays))
        meet_static(scene.static, start, direction, centre, reach, solid, pane)
        for row, beams in self._windows(scene, ego, lidar_in_ego, time_s, instances):
            meet_instance(scene, instances, row, beams, start, direction, centre, time_s, reach, solid, pane)
        beam = np.flatnonzero(pane.distance < solid.distance).astype(np.int32)
        hits = Hits(
            rays=self.rays,
            pose=ego.pose @ lidar_in_ego,
            solid=solid.surface(self._near),
            pane_beam=beam,
            pane=pane.surface(self._near, beam),
            paint=instances.paint,
        )
        return hits, origin, direction

    def _windows(
        self, scene: Scene, ego: EgoMotion, lidar_in_ego: np.ndarray, time_s: np.ndarray, instances: Instances
    ) -> list[tuple[int, np.ndarray]]:
        """Instances and the rays that may meet them at any instant of the sweep."""
        if not len(instances):
            return []
        bounds = np.stack([scene.model(name).bounds for name in instances.models])
        corner = np.where(_CORNERS[None], bounds[:, None, 1], bounds[:, None, 0]) * instances.scales[:, None, :]
        corners, nearest = [], []
        for instant in np.linspace(time_s.min(), time_s.max(), _INSTANTS):
            placed = moved_poses(instances.poses, instances.velocity_mps, instances.yaw_rate_radps, float(instant))
            seen = np.linalg.inv(ego.pose_at(float(instant)) @ lidar_in_ego) @ placed
            corners.append(np.einsum("kij,kcj->kci", seen[:, :3, :3], corner) + seen[:, None, :3, 3])
            sensor = -np.einsum("kji,kj->ki", seen[:, :3, :3], seen[:, :3, 3])
            low, high = bounds[:, 0] * instances.scales, bounds[:, 1] * instances.scales
            nearest.append(np.linalg.norm(np.maximum(np.maximum(low - sensor, sensor - high), 0), axis=1))
        swept = np.concatenate(corners, axis=1)
        middle = swept.mean(1, keepdims=True)
        swept += np.sign(swept - middle) * _WINDOW_MARGIN_M
        near = np.maximum(np.min(nearest, axis=0) - 0.1, 0)
        reach = np.flatnonzero(near < self._far)
        reach = reach[np.argsort(near[reach], kind="stable")]
        beams, box = self._index.window_pairs(swept[reach], near[reach])
        ends = np.searchsorted(box, np.arange(len(reach) + 1))
        return [(int(row), beams[ends[i] : ends[i + 1]]) for i, row in enumerate(reach) if ends[i] < ends[i + 1]]


def shoot(
    scene: Scene, instances: Instances, origin: np.ndarray, direction: np.ndarray, time_s: np.ndarray, limit_m: float
) -> Surface:
    """First solid surface along single rays (k, 3) in world axes, each at its own instant (k,)."""
    solid, pane = Nearest(len(origin)), Nearest(len(origin))
    if len(origin):
        centre = origin.mean(0)
        start, direction = (origin - centre).astype(np.float32), direction.astype(np.float32)
        reach = np.float32(limit_m)
        meet_static(scene.static, start, direction, centre, reach, solid, pane)
        for row in range(len(instances)):
            bounds = scene.model(instances.models[row]).bounds * instances.scales[row]
            radius = float(np.abs(bounds).max(0) @ np.abs(bounds).max(0)) ** 0.5
            place = (instances.poses[row, :3, 3] - centre).astype(np.float32)
            offset = place + instances.velocity_mps[row].astype(np.float32) * time_s[:, None] - start
            along = np.einsum("ij,ij->i", offset, direction)
            aside = np.einsum("ij,ij->i", offset, offset) - np.maximum(along, 0) ** 2
            beams = np.flatnonzero((aside < radius**2) & (along < reach + radius))
            meet_instance(scene, instances, row, beams, start, direction, centre, time_s, reach, solid, pane)
    return solid.surface(0.0)


def meet_static(
    static: Bvh,
    start: np.ndarray,
    direction: np.ndarray,
    centre: np.ndarray,
    reach: np.float32,
    solid: Nearest,
    pane: Nearest,
) -> None:
    """Offer the static world to all rays; behind panes they go on."""
    if static.is_empty:
        return
    start = start + centre.astype(np.float32)
    travelled, triangle = static.first_hit(start, direction, np.full(len(start), reach, np.float32))
    glass = static.is_glass[triangle] & (triangle >= 0)
    solid.fill(travelled, triangle, static, (triangle >= 0) & ~glass)
    beams = np.flatnonzero(glass)
    travelled, triangle = travelled[beams], triangle[beams]
    pane.offer(beams, travelled, static.packed_normal[triangle], static.material[triangle], STATIC)
    for _ in range(_MOST_PANES):
        if not len(beams):
            return
        travelled = travelled + np.float32(_STEP_BEHIND_GLASS_M)
        begin = start[beams] + direction[beams] * travelled[:, None]
        step, triangle = static.first_hit(begin, direction[beams], reach - travelled)
        hit = triangle >= 0
        beams, travelled, triangle = beams[hit], (travelled + step)[hit], triangle[hit]
        glass = static.is_glass[triangle]
        rows, face = beams[~glass], triangle[~glass]
        solid.offer(rows, travelled[~glass], static.packed_normal[face], static.material[face], STATIC)
        beams, travelled = beams[glass], travelled[glass]


def meet_instance(
    scene: Scene,
    instances: Instances,
    row: int,
    beams: np.ndarray,
    start: np.ndarray,
    direction: np.ndarray,
    centre: np.ndarray,
    time_s: np.ndarray,
    reach: np.float32,
    solid: Nearest,
    pane: Nearest,
) -> None:
    """Offer one instance to some rays, each carried into its frame at the ray's own instant."""
    if not len(beams):
        return
    model, instant = scene.model(instances.models[row]), time_s[beams]
    angle = np.float32(instances.yaw_rate_radps[row]) * instant
    shift = (instances.poses[row, :3, 3] - centre).astype(np.float32)
    place = shift + instances.velocity_mps[row].astype(np.float32) * instant[:, None]
    unscaled = np.linalg.inv(instances.poses[row, :3, :3] * instances.scales[row]).astype(np.float32)

    def carry(vectors: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(yawed(vectors, -angle) @ unscaled.T)

    origin, onward = carry(start[beams] - place), carry(direction[beams])
    limit = np.minimum(solid.distance[beams], reach)
    distance, triangle = model.whole.first_hit(origin, onward, limit)
    hit = triangle >= 0
    glass = hit & model.whole.is_glass[triangle]
    behind = np.flatnonzero(glass)
    step, inner = model.opaque.first_hit(origin[behind], onward[behind], limit[behind])
    met = (
        (pane, model.whole, behind, distance[behind], triangle[behind]),
        (solid, model.whole, np.flatnonzero(hit & ~glass), distance[hit & ~glass], triangle[hit & ~glass]),
        (solid, model.opaque, behind[inner >= 0], step[inner >= 0], inner[inner >= 0]),
    )
    for nearest, bvh, rays, at, face in met:
        normal = yawed(bvh.normal[face] @ unscaled, angle[rays])
        code = encode_normals(normal).view(np.int32).reshape(-1)
        nearest.offer(beams[rays], at, code, bvh.material[face], row)


class Nearest:
    """The nearest surface offered so far to each of n rays."""

    def __init__(self, rays: int) -> None:
        self.distance = np.full(rays, np.inf, np.float32)
        self._code = np.zeros(rays, np.int32)
        self._material = np.zeros(rays, np.uint8)
        self._instance = np.full(rays, NOTHING, np.int16)

    def fill(self, distance: np.ndarray, triangle: np.ndarray, bvh: Bvh, hit: np.ndarray) -> None:
        """Surfaces of the static world for all rays where `hit`, when nothing was offered before."""
        self.distance = np.where(hit, distance, np.float32(np.inf))
        self._code, self._material = bvh.packed_normal[triangle], bvh.material[triangle]
        self._instance = np.where(hit, np.int16(STATIC), np.int16(NOTHING))

    def offer(
        self, rays: np.ndarray, distance: np.ndarray, code: np.ndarray, material: np.ndarray, instance: int
    ) -> None:
        """Surfaces of one thing, at most one a ray."""
        nearer = np.flatnonzero(distance < self.distance[rays])
        rows = rays[nearer]
        self.distance[rows] = distance[nearer]
        self._code[rows] = code[nearer]
        self._material[rows] = material[nearer]
        self._instance[rows] = instance

    def surface(self, offset_m: float, rays: np.ndarray | slice = slice(None)) -> Surface:
        """The surfaces of `rays`, ranges counted from the optical centre and rounded to the stored step."""
        steps = np.rint((self.distance[rays] + np.float32(offset_m)) / np.float32(RANGE_STEP_M))
        steps *= np.float32(RANGE_STEP_M)
        return Surface(
            range_m=steps,
            normal_code=self._code[rays].view(np.int16).reshape(-1, 2),
            material=self._material[rays],
            instance=self._instance[rays],
        )


def _carried_rays(
    rays: Rays, ego: EgoMotion, lidar_in_ego: np.ndarray, time_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Origins, from the sensor's place at the pose time, and directions of the rays in world axes, (n, 3) float32."""
    now = (ego.pose @ lidar_in_ego)[:3, :3].astype(np.float32)
    arm = (ego.pose[:3, :3] @ lidar_in_ego[:3, 3]).astype(np.float32)
    angle = np.float32(ego.yaw_rate_radps) * time_s
    direction = yawed(rays.direction @ now.T, angle)
    lever = rays.origin @ now.T + arm if rays.origin.any() else np.broadcast_to(arm, direction.shape)
    travelled = time_s[:, None] * np.asarray(ego.velocity_mps, np.float32)
    travelled += yawed(lever, angle) - arm
    return travelled, direction


def yawed(vectors: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) float32, each turned about z by its own angle (n,)."""
    if not angle.any():
        return vectors
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.empty(vectors.shape, np.float32)
    turned[:, 0] = cos * vectors[:, 0] - sin * vectors[:, 1]
    turned[:, 1] = sin * vectors[:, 0] + cos * vectors[:, 1]
    turned[:, 2] = vectors[:, 2]
    return turned
