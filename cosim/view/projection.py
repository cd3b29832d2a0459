"""Pinhole views in LiDAR axes, of a virtual or a real camera; boxes as clipped wire frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim.drives.kitti import Calibration

_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A pinhole camera.

    Attributes:
        matrix: (3, 4) projection from homogeneous LiDAR coordinates to (u·d, v·d, d), d being the depth [m]; (0, 0) is
            the centre of the top left pixel.
        focal_px: focal length [px].
        width, height: image size [px].
        near_m: distance of the near clipping plane [m].
    """

    matrix: np.ndarray
    focal_px: float
    width: int
    height: int
    near_m: float = 0.3

    @classmethod
    def looking(
        cls,
        eye: tuple[float, float, float] | np.ndarray,
        target: tuple[float, float, float] | np.ndarray,
        *,
        width: int,
        height: int,
        field_deg: float,
        near_m: float = 0.3,
    ) -> Viewpoint:
        """A view from `eye` towards `target` [m, LiDAR axes], z up, `field_deg` wide."""
        eye = np.asarray(eye, np.float64)
        forward = np.asarray(target, np.float64) - eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        focal = width / 2 / np.tan(np.radians(field_deg) / 2)
        intrinsics = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
        return cls(intrinsics @ np.column_stack([rotation, -rotation @ eye]), float(focal), width, height, near_m)

    @classmethod
    def of_camera(cls, calibration: Calibration, camera: int, width: int, height: int) -> Viewpoint:
        """The view of a KITTI camera."""
        projection = calibration.projection(camera)
        return cls(projection @ calibration.velo_to_rect_matrix, float(projection[0, 0]), width, height)

    def enlarged(self, factor: int) -> Viewpoint:
        """Return the view with `factor` times as many pixels in each direction."""
        # pixel centres: u' = factor·(u + ½) − ½
        shift = (factor - 1) / 2
        resize = np.array([[factor, 0, shift], [0, factor, shift], [0, 0, 1]])
        return replace(
            self,
            matrix=resize @ self.matrix,
            focal_px=self.focal_px * factor,
            width=self.width * factor,
            height=self.height * factor,
        )

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (n, 2), NaN for what is not before the camera, and depths (n,) [m] of points (n, ≥ 3)."""
        carried = self._carry(points)
        depth = carried[:, 2]
        before = depth >= self.near_m
        uv = np.full((len(carried), 2), np.nan)
        uv[before] = carried[before, :2] / depth[before, None]
        return uv, depth

    def segments(self, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Lines between points (n, 3), cut before the camera: the k that are seen, (k, 2, 2) pixels."""
        start, end = self._carry(starts), self._carry(ends)
        seen = (start[:, 2] > self.near_m) | (end[:, 2] > self.near_m)
        start, end = start[seen], end[seen]
        start, end = self._cut(start, end), self._cut(end, start)
        return np.stack([start[:, :2] / start[:, 2:], end[:, :2] / end[:, 2:]], 1)

    def wire(self, corners: np.ndarray) -> np.ndarray:
        """The edges of one box (8, 3) as lines (k, 2, 2) in pixels."""
        return self.segments(corners[_EDGES[:, 0]], corners[_EDGES[:, 1]])

    def inside(self, uv: np.ndarray) -> np.ndarray:
        """(n,) bool: which pixels (n, 2) lie in the image."""
        with np.errstate(invalid="ignore"):
            return np.all((uv >= -0.5) & (uv < [self.width - 0.5, self.height - 0.5]), axis=1)

    def _carry(self, points: np.ndarray) -> np.ndarray:
        return np.asarray(points, np.float64)[:, :3] @ self.matrix[:, :3].T + self.matrix[:, 3]

    def _cut(self, inner: np.ndarray, outer: np.ndarray) -> np.ndarray:
        """`inner` moved along the line to `outer` until it is `near_m` before the camera."""
        gap = outer[:, 2] - inner[:, 2]
        behind = inner[:, 2] < self.near_m
        share = np.divide(self.near_m - inner[:, 2], gap, out=np.zeros_like(gap), where=behind)
        return inner + share[:, None] * (outer - inner)
