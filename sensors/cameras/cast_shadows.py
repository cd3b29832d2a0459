"""Shadows of moving objects on the ground, added to an image after it is drawn.

The static world's own shadows are baked (`SunShadows`). A vehicle's is the projection of its convex hull along the
sunlight onto the ground plane below it; ground within it loses the sun's part of its light, where it has that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from scipy.spatial import ConvexHull

from assets.materials import material_index
from assets.mesh import Mesh
from sensors.bvh import Bvh
from sensors.cameras.images import Images
from sensors.cameras.light import Light
from sensors.scene import Instances

_GROUND = ("asphalt", "asphalt_patch", "road_marking", "manhole", "kerb", "paving", "cobble", "gravel", "grass", "soil")
_REACH_M = 80.0
_LOWEST_SUN = 0.08  # sine of its elevation; shadows grow without bound below
_NEAR_M = 0.5
_BEHIND_M = 12.0  # objects farther behind cast no shadow into the image
_FARTHEST_PX = 20_000.0
_OFF_PLANE_M = 0.4  # kerbs and slopes within this of the plane take the shadow
_SUN_REACH_M, _LIFT_M = 150.0, 0.05


class CastShadows:
    """Darkens the ground in the shadows of instances.

    Args:
        load: gives the mesh of a model's name.
        light: of the scene.
        static: the static world, whose shadows are drawn already.
    """

    def __init__(self, load: Callable[[str], Mesh], light: Light, static: Bvh) -> None:
        self._load, self._static = load, static
        self._sun = np.array(light.sun_direction)
        sun, sky = np.array(light.sun_rgb) * max(float(self._sun[2]), 0.0), np.array(light.sky_rgb)
        self._left = np.sqrt(sky / (sun + sky))  # images hold the square root of light
        self._outlines: dict[str, tuple[bytes, np.ndarray]] = {}
        self._is_ground = np.zeros(256, bool)
        self._is_ground[[material_index(name) + 1 for name in _GROUND]] = True

    def onto(self, images: Images, pose: np.ndarray, P: np.ndarray, instances: Instances) -> Images:
        """Images with shadows.

        Args:
            images: with colour, number and depth.
            pose: (4, 4) world-from-camera.
            P: (3, 4) projection.
            instances: instances and their poses.
        """
        if self._sun[2] < _LOWEST_SUN or images.rgba is None or not len(instances):
            return images
        owner, (top, left) = self._fallen(images.rgba.shape[:2], pose, P, instances)
        rows, columns = np.nonzero(owner)
        caster = owner[rows, columns] - 1
        rows, columns = rows + top, columns + left
        is_ground = self._is_ground[images.rgba[rows, columns, 3]] & (images.instance[rows, columns] == 0)
        rows, columns, caster = rows[is_ground], columns[is_ground], caster[is_ground]
        points = world_points(rows, columns, images.depth_at(rows, columns), pose, P)
        foot, normal = instances.poses[:, :3, 3], instances.poses[:, :3, 2]
        above = np.einsum("ij,ij->i", points - foot[caster], normal[caster])
        on_plane = np.abs(above) < _OFF_PLANE_M
        rows, columns, points = rows[on_plane], columns[on_plane], points[on_plane]
        if not len(rows):
            return images
        points[:, 2] += _LIFT_M
        towards = np.tile(self._sun.astype(np.float32), (len(points), 1))
        lit = ~self._static.blocks(points.astype(np.float32), towards, _SUN_REACH_M)
        rgba = images.rgba.copy()
        rows, columns = rows[lit], columns[lit]
        rgba[rows, columns, :3] = np.rint(rgba[rows, columns, :3] * self._left).astype(np.uint8)
        return replace(images, rgba=rgba)

    def _fallen(
        self, shape: tuple[int, ...], pose: np.ndarray, P: np.ndarray, instances: Instances
    ) -> tuple[np.ndarray, tuple[int, int]]:
        """Row + 1 of the instance whose shadow is at a pixel, on the instance's ground plane, int32; else 0.

        Returns:
            The part (h, w) of the image that holds all shadows, and its first row and column.
        """
        into_camera = (instances.poses[:, :3, 3] - pose[:3, 3]) @ pose[:3, :3]
        away = np.linalg.norm(into_camera, axis=1)
        near = (away < _REACH_M) & (into_camera[:, 2] > -_BEHIND_M)
        rows = np.flatnonzero(near)
        rows = rows[np.argsort(-away[rows], kind="stable")].tolist()
        outlines = _seen([self._kept_outline(instances, row) for row in rows], pose, P)
        drawn = [
            (row, outline)
            for row, outline in zip(rows, outlines, strict=True)
            if len(outline) and (outline.max(0) >= 0).all() and (outline.min(0) < shape[::-1]).all()
        ]
        if not drawn:
            return np.zeros((0, 0), np.int32), (0, 0)
        corners = np.concatenate([outline for _, outline in drawn])
        left, top = np.maximum(corners.min(0), 0).tolist()
        right, bottom = np.minimum(corners.max(0) + 1, shape[::-1]).tolist()
        owner = np.zeros((bottom - top, right - left), np.int32)
        for row, outline in drawn:
            cv2.fillConvexPoly(owner, outline - np.array([left, top], np.int32), row + 1)
        return owner, (top, left)

    def _kept_outline(self, instances: Instances, row: int) -> np.ndarray:
        """`_outline`, cached while an instance does not move: for the next camera, or frame if it is parked."""
        name = instances.ids[row]
        state = instances.models[row].encode() + instances.poses[row].tobytes() + instances.scales[row].tobytes()
        known = self._outlines.get(name)
        if known is None or known[0] != state:
            known = self._outlines[name] = state, self._outline(instances, row)
        return known[1]

    def _outline(self, instances: Instances, row: int) -> np.ndarray:
        """Corners (k, 3) of an instance's shadow on its ground plane."""
        stands = instances.poses[row]
        foot, normal = stands[:3, 3], stands[:3, 2]
        hull = self._load(instances.models[row]).hull.astype(np.float64)
        corners = (hull * instances.scales[row]) @ stands[:3, :3].T + foot
        fallen = corners - np.outer((corners - foot) @ normal / (self._sun @ normal), self._sun)
        flat = (fallen - foot) @ stands[:3, :2]
        return fallen[ConvexHull(flat).vertices]


def world_points(v: np.ndarray, u: np.ndarray, depth_m: np.ndarray, pose: np.ndarray, P: np.ndarray) -> np.ndarray:
    """World points (n, 3) of pixels with depths along the optical axis."""
    pixels = np.column_stack([u, v, np.ones(len(u))]) * depth_m[:, None] - P[:, 3]
    return np.linalg.solve(P[:, :3], pixels.T).T @ pose[:3, :3].T + pose[:3, 3]


def _seen(outlines: list[np.ndarray], pose: np.ndarray, P: np.ndarray) -> list[np.ndarray]:
    """Pixels (k, 2) int32 of convex outlines (n, 3), clipped at the camera; none of an outline behind the camera."""
    if not outlines:
        return []
    projected = ((np.concatenate(outlines) - pose[:3, 3]) @ pose[:3, :3]) @ P[:, :3].T + P[:, 3]
    is_ahead = projected[:, 2] >= _NEAR_M
    pixels = _pixels(projected)
    ends = np.cumsum([len(outline) for outline in outlines]).tolist()
    seen = []
    for start, end in zip([0, *ends], ends, strict=False):
        seen.append(pixels[start:end] if is_ahead[start:end].all() else _pixels(_clipped(projected[start:end])))
    return seen


def _clipped(outline: np.ndarray) -> np.ndarray:
    """The part (k, 3) of a projected convex outline (n, 3) that is in front of the camera."""
    ends = np.roll(outline, -1, axis=0)
    kept = []
    for start, end in zip(outline, ends, strict=True):
        if start[2] >= _NEAR_M:
            kept.append(start)
        if (start[2] >= _NEAR_M) != (end[2] >= _NEAR_M):
            kept.append(start + (end - start) * (_NEAR_M - start[2]) / (end[2] - start[2]))
    return np.reshape(kept, (-1, 3))


def _pixels(projected: np.ndarray) -> np.ndarray:
    """Nearest pixels (n, 2) int32 of projected points (n, 3)."""
    depth = np.maximum(projected[:, 2:], _NEAR_M)
    return np.rint(np.clip(projected[:, :2] / depth, -_FARTHEST_PX, _FARTHEST_PX)).astype(np.int32)
