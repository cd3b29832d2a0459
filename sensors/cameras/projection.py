"""Conversion of KITTI's projection matrix to OpenGL's clip space, and tests of what lies inside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sensors.cameras.errors import CameraError


@dataclass(frozen=True, eq=False)
class View:
    """One camera at one instant.

    Attributes:
        camera_from_world: (4, 4) float64, camera-0 axes x right, y down, z forward.
        clip: (4, 4) float64 clip-from-camera.
        planes: (6, 4) float64 frustum planes, world axes.
        eye: (3,) float64 centre of camera 0, world axes [m].
        near_m: near plane [m].
        focal_px: the longer focal length.
    """

    camera_from_world: np.ndarray
    clip: np.ndarray
    planes: np.ndarray
    eye: np.ndarray
    near_m: float
    focal_px: float

    @classmethod
    def of(cls, pose: np.ndarray, P: np.ndarray, size_px: tuple[int, int], range_m: tuple[float, float]) -> View:
        """From world-from-camera pose (4, 4), P (3, 4), width and height [px], near and far [m]."""
        pose = np.asarray(pose, np.float64)
        clip = clip_matrix(P, *size_px, range_m[0])
        inverse = np.linalg.inv(pose)
        planes = frustum_planes(clip @ inverse, range_m[1])
        return cls(inverse, clip, planes, pose[:3, 3].copy(), range_m[0], float(max(P[0][0], P[1][1])))


def clip_matrix(P: np.ndarray, width: int, height: int, near_m: float) -> np.ndarray:
    """Clip-from-camera matrix, (4, 4) float64, for a depth range of 0–1 that runs backwards.

    Integer pixel (u, v) lands on the centre of a sample; rows run downwards, so the first row read back is
    the image's top. The depth buffer holds near_m / depth: 1 at the near plane, 0 at infinity, which a
    float buffer keeps to seven digits at any distance.

    Args:
        P: (3, 4) projection K [I | t], camera axes x right, y down, z forward.
        width, height: image size [px].
        near_m: near plane [m].
    """
    P = np.asarray(P, np.float64)
    if P.shape != (3, 4) or abs(np.linalg.det(P[:, :3])) < 1e-9:
        raise CameraError(f"P has shape {P.shape} or is singular: give a 3 × 4 matrix K [I | t]")
    matrix = np.empty((4, 4))
    matrix[0] = 2.0 / width * P[0] + (1.0 / width - 1.0) * P[2]
    matrix[1] = 2.0 / height * P[1] + (1.0 / height - 1.0) * P[2]
    matrix[2] = (0.0, 0.0, 0.0, near_m)
    matrix[3] = P[2]
    return matrix


def frustum_planes(clip_from_world: np.ndarray, far_m: float) -> np.ndarray:
    """Frustum planes (6, 4) float64 with unit normals, a·x + d ≥ 0 inside: four sides, near and far."""
    x, y, z, w = clip_from_world
    planes = np.stack([w + x, w - x, w + y, w - y, w - z, [0, 0, 0, far_m] - w])
    return planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True)


def spheres_inside(planes: np.ndarray, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """True where a sphere (n, 3), (n,) may be seen, (n,) bool."""
    return np.all(centre @ planes[:, :3].T + planes[:, 3] >= -radius[:, None], axis=1)


def boxes_inside(planes: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """True where an axis-aligned box (n, 2, 3) may be seen, (n,) bool."""
    normal = planes[:, :3]
    farthest = np.where(normal[None] >= 0, bounds[:, 1][:, None], bounds[:, 0][:, None])
    return np.all((farthest * normal).sum(2) + planes[:, 3] >= 0, axis=1)
