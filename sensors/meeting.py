"""What rays of a moving world meet: the static world and instances offer surfaces, the nearest stands."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from sensors.bvh import Bvh
from sensors.hits import NOTHING, RANGE_STEP_M, STATIC, Surface
from sensors.normals import encode_normals
from sensors.scene import Instances, Scene

_STEP_BEHIND_GLASS_M = 1e-3
_MOST_PANES = 16


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
        near = KDTree(start[:, :2])
        for row in range(len(instances)):
            bounds = scene.model(instances.models[row]).bounds * instances.scales[row]
            radius = float(np.abs(bounds).max(0) @ np.abs(bounds).max(0)) ** 0.5
            place = (instances.poses[row, :3, 3] - centre).astype(np.float32)
            travel = float(np.linalg.norm(instances.velocity_mps[row])) * float(np.abs(time_s).max())
            if near.query(place[:2])[0] > limit_m + radius + travel:
                continue
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
