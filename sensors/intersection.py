"""Intersection of rays with the static world and instances: the nearest surface is the hit."""

from __future__ import annotations

import numpy as np

from sensors.bvh import Bvh
from sensors.hit_buffer import HitBuffer
from sensors.hits import Surface
from sensors.scene import Instances, Scene

_STEP_BEHIND_GLASS_M = 1e-3
_MOST_PANES = 16
_AT_ONCE = 4096
_SLACK_M = np.float32(0.05)  # single precision


def shoot(
    scene: Scene, instances: Instances, origin: np.ndarray, direction: np.ndarray, time_s: np.ndarray, limit_m: float
) -> Surface:
    """First solid surface along single rays (k, 3) in world axes, each at its own instant (k,)."""
    limit = np.full(len(origin), limit_m, np.float32)
    solid, pane = HitBuffer.nothing(limit), HitBuffer.nothing(limit)
    if len(origin):
        centre = origin.mean(0)
        start, direction = (origin - centre).astype(np.float32), direction.astype(np.float32)
        solid, pane = meet_static(scene.static, start + centre.astype(np.float32), direction, limit)
        for row, rays in _instances_near(scene, instances, start, direction, centre, time_s, solid.distance):
            meet_instance(scene, instances, row, rays, start, direction, centre, time_s, solid, pane)
    solid.settle()
    return solid.surface()


def _instances_near(
    scene: Scene,
    instances: Instances,
    start: np.ndarray,
    direction: np.ndarray,
    centre: np.ndarray,
    time_s: np.ndarray,
    limit: np.ndarray,
) -> list[tuple[int, np.ndarray]]:
    """Instances whose spheres rays pass nearer than their limits (n,), in order, and which rays do.

    Args:
        scene, instances, centre: as in `meet_instance`.
        start, direction: (n, 3) float32 of the rays, from `centre`.
        time_s: (n,) float32 their instants.
        limit: (n,) float32.
    """
    if not len(instances):
        return []
    corners = {name: np.abs(scene.model(name).bounds).max(0) for name in set(instances.models)}
    corner = np.array([corners[name] for name in instances.models]) * instances.scales
    radius = np.linalg.norm(corner, axis=1).astype(np.float32) + _SLACK_M
    position = (instances.poses[:, :3, 3] - centre).astype(np.float32)
    velocity = instances.velocity_mps.astype(np.float32)
    travel = np.linalg.norm(velocity, axis=1) * float(np.abs(time_s).max())
    low, high = start[:, :2].min(0), start[:, :2].max(0)
    apart = np.linalg.norm(np.maximum(np.maximum(low - position[:, :2], position[:, :2] - high), 0), axis=1)  # at least
    rows = np.flatnonzero(apart <= limit.max() + radius + travel)
    found: list[list[np.ndarray]] = [[] for _ in rows]
    for first in range(0, len(start), _AT_ONCE):
        rays = slice(first, first + _AT_ONCE)
        onward, far = direction[rays], limit[rays]
        along, square = np.zeros((2, len(rows), len(onward)), np.float32)
        for axis in range(3):
            offset = position[rows, axis, None] - start[rays, axis]
            if velocity[rows].any():
                offset += velocity[rows, axis, None] * time_s[rays]
            along += offset * onward[:, axis]
            square += offset * offset
        reach = radius[rows, None]
        passed = (square - np.square(np.maximum(along, 0)) < reach * reach) & (along < far + reach)
        for number in np.flatnonzero(passed.any(1)):
            found[number].append(first + np.flatnonzero(passed[number]))
    return [(int(row), np.concatenate(rays)) for row, rays in zip(rows, found, strict=True) if rays]


def meet_static(
    static: Bvh, origin: np.ndarray, direction: np.ndarray, limit: np.ndarray, near: float = 0.0
) -> tuple[HitBuffer, HitBuffer]:
    """First solid surface of each ray in the static world, and first pane of those that pass glass before it.

    Args:
        static: the world.
        origin: (n, 3) float32 world axes.
        direction: (n, 3) float32.
        limit: (n,) float32 farthest distance.
        near: smallest distance of a surface.
    """
    pane = HitBuffer.nothing(limit)
    if static.is_empty:
        return HitBuffer.nothing(limit), pane
    distance, triangle = static.first_hit(origin, direction, limit, near)
    solid = HitBuffer(distance, static.records.take(triangle))
    behind = np.flatnonzero(solid.glass)
    travelled = distance[behind]
    pane.put(behind, travelled, solid.records[behind])
    solid.put(behind, limit[behind], static.records[-1])
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
        solid.put(behind[done], travelled[done], static.records[triangle[done]])
        behind, travelled = behind[glass], travelled[glass]
    return solid, pane


def meet_instance(
    scene: Scene,
    instances: Instances,
    row: int,
    beams: np.ndarray,
    origin: np.ndarray,
    direction: np.ndarray,
    centre: np.ndarray,
    time_s: np.ndarray,
    solid: HitBuffer,
    pane: HitBuffer,
    near: float = 0.0,
    *,
    panes: bool = True,
) -> None:
    """Offer one instance to some rays, each carried into its frame at the ray's own instant.

    Args:
        scene: gives its model.
        instances: at the pose time.
        row: which of them.
        beams: (k,) rows of the rays.
        origin: (n, 3) float32 origins of all rays from `centre`.
        direction: (n, 3) float32.
        centre: (3,) world axes.
        time_s: (n,) float32 instants from the pose time.
        solid, pane: what they met so far; to be settled afterwards.
        near: smallest distance of a surface.
        panes: whether its panes are included; without them its glass is ignored.
    """
    if not len(beams):
        return
    model, instant = scene.model(instances.models[row]), time_s[beams]
    outer = model.whole if panes else model.opaque
    angle = np.float32(instances.yaw_rate_radps[row]) * instant
    shift = (instances.poses[row, :3, 3] - centre).astype(np.float32)
    position = shift + instances.velocity_mps[row].astype(np.float32) * instant[:, None]
    unscaled = np.linalg.inv(instances.poses[row, :3, :3] * instances.scales[row]).astype(np.float32)
    turns = bool(instances.yaw_rate_radps[row])

    def carry(vectors: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray((yawed(vectors, -angle) if turns else vectors) @ unscaled.T)

    def normals_of(bvh: Bvh, face: np.ndarray, rays: np.ndarray) -> np.ndarray:
        normals = bvh.normal[face] @ unscaled
        return yawed(normals, angle[rays]) if turns else normals

    start, onward = carry(origin[beams] - position), carry(direction[beams])
    limit = solid.distance[beams]
    distance, triangle = outer.first_hit(start, onward, limit, near)
    hit = np.flatnonzero(triangle >= 0)
    if not len(hit):
        return
    beams, distance, triangle = beams[hit], distance[hit], triangle[hit]
    normals = normals_of(outer, triangle, hit)
    glass = np.flatnonzero(outer.is_glass[triangle])
    if len(glass):
        through, behind = beams[glass], hit[glass]
        pane.offer_instance(through, distance[glass], outer.records[triangle[glass]], normals[glass], row)
        distance[glass] = np.inf
        step, inner = model.opaque.first_hit(start[behind], onward[behind], limit[behind], near)
        met = np.flatnonzero(inner >= 0)
        inner = inner[met]
        inner_normals = normals_of(model.opaque, inner, behind[met])
        solid.offer_instance(through[met], step[met], model.opaque.records[inner], inner_normals, row)
    solid.offer_instance(beams, distance, outer.records[triangle], normals, row)


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
