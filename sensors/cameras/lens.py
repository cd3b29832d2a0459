"""Lens distortion: distorted images from those of a pinhole camera.

OpenCV, Camera Calibration and 3D Reconstruction: `brown` is its plumb-bob model, radial and tangential coefficients
k1 k2 p1 p2 k3 (Brown, Close-Range Camera Calibration, Photogrammetric Engineering 37, 1971); `fisheye` its
equidistant model, θ·(1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) (Kannala and Brandt, PAMI 28, 2006).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import cv2
import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from sensors.cameras.images import Images

_WIDEST_TAN = np.tan(np.radians(75.0))  # a pinhole's plane grows without bound towards 90°
_LARGEST_PX = 4096
_COUNTS = {"brown": (4, 5), "fisheye": (4,)}
_SETTLES_PX = 0.05


class Distortion(BaseModel):
    """Distortion of a lens."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    model: Literal["brown", "fisheye"] = Field(default="brown", description="plumb bob, or equidistant fisheye")
    coefficients: tuple[float, ...] = Field(description="brown: k1 k2 p1 p2 [k3]; fisheye: k1 k2 k3 k4")

    @model_validator(mode="after")
    def _counted(self) -> Distortion:
        if len(self.coefficients) not in _COUNTS[self.model]:
            wanted = " or ".join(map(str, _COUNTS[self.model]))
            raise ValueError(f"{self.model} has {len(self.coefficients)} coefficients; give {wanted}")
        if not np.isfinite(self.coefficients).all():
            raise ValueError("coefficients hold NaN or infinity; give finite numbers")
        return self

    def check(self, K: np.ndarray, width: int, height: int) -> None:
        """Raise ValueError unless an image of this size can be made with this camera matrix."""
        rays = self.rays(K, width, height)
        again, depth = self.pixels(np.dstack([rays, np.ones(rays.shape[:2])]).reshape(-1, 3), K)
        grid = _grid(width, height).reshape(-1, 2)
        if not np.isfinite(rays).all() or np.abs(again - grid).max() > _SETTLES_PX or depth.min() <= 0:
            raise ValueError("this distortion cannot be undone within the image; lower its coefficients")
        if np.abs(rays).max() > _WIDEST_TAN:
            raise ValueError(
                "this lens has a half field of view above 75°; give a longer focal length or a smaller image"
            )

    def rays(self, K: np.ndarray, width: int, height: int) -> np.ndarray:
        """Normalised coordinates x/z and y/z of every pixel, (h, w, 2)."""
        pixels = _grid(width, height).reshape(-1, 1, 2)
        coefficients = np.array(self.coefficients)
        if self.model == "fisheye":
            rays = cv2.fisheye.undistortPoints(pixels, K, coefficients)
        else:
            criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10)
            rays = cv2.undistortPoints(pixels, K, coefficients, R=np.eye(3), P=np.eye(3), criteria=criteria)
        return rays.reshape(height, width, 2)

    def pixels(self, points: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (n, 2) and depths (n,) of points (n, 3) in camera axes; pixels mean something where depth > 0."""
        points = np.asarray(points, np.float64).reshape(-1, 3)
        depth = points[:, 2]
        flat = points / np.where(depth > 1e-6, depth, 1.0)[:, None]
        flat[:, 2] = 1.0
        coefficients, still = np.array(self.coefficients), np.zeros(3)
        if self.model == "fisheye":
            found, _ = cv2.fisheye.projectPoints(flat.reshape(1, -1, 3), still, still, K, coefficients)
        else:
            found, _ = cv2.projectPoints(flat.reshape(-1, 1, 3), still, still, K, coefficients)
        return found.reshape(-1, 2), depth


@dataclass(frozen=True, eq=False)
class Lens:
    """A lens, and a pinhole camera whose image contains everything that the lens sees.

    Attributes:
        source_projection: (3, 4) projection of the pinhole camera whose image is distorted.
        source_size: its width and height [px].
        K: (3, 3) of the camera.
        size: width and height of the camera's image [px].
        distortion: of the lens.
    """

    source_projection: np.ndarray
    source_size: tuple[int, int]
    K: np.ndarray
    size: tuple[int, int]
    distortion: Distortion

    @classmethod
    def of(cls, K: np.ndarray, width: int, height: int, distortion: Distortion) -> Lens:
        """The lens of a camera; its pinhole has the camera's focal length, so that the middle stays as sharp."""
        rays = distortion.rays(K, width, height).reshape(-1, 2)
        plain = _undistorted(K, width, height).reshape(-1, 2)  # the image without the lens is wanted of it, too
        low = np.minimum(rays.min(0), plain.min(0))
        high = np.maximum(rays.max(0), plain.max(0))
        focal = np.array([K[0, 0], K[1, 1]])
        focal *= min(1.0, _LARGEST_PX / float((focal * (high - low)).max()))
        size = np.ceil(focal * (high - low)).astype(int) + 3
        centre = 1.0 - focal * low
        P = np.array([[focal[0], 0, centre[0], 0], [0, focal[1], centre[1], 0], [0, 0, 1.0, 0]])
        return cls(P, (int(size[0]), int(size[1])), K, (width, height), distortion)

    def bent(self, images: Images) -> Images:
        """Distort an image of the pinhole camera."""
        return _remapped(images, self._bent_map)

    def straight(self, images: Images) -> Images:
        """Undistort an image: that of a camera with the same matrix and size without distortion."""
        return _remapped(images, self._straight_map)

    @cached_property
    def _bent_map(self) -> np.ndarray:
        return self._source_pixels(self.distortion.rays(self.K, *self.size))

    @cached_property
    def _straight_map(self) -> np.ndarray:
        return self._source_pixels(_undistorted(self.K, *self.size))

    def _source_pixels(self, rays: np.ndarray) -> np.ndarray:
        P = self.source_projection
        return (rays * [P[0, 0], P[1, 1]] + [P[0, 2], P[1, 2]]).astype(np.float32)


def undistorted(image: np.ndarray, K: np.ndarray, distortion: Distortion) -> np.ndarray:
    """An image without its distortion: straight lines are straight, and P projects into it."""
    height, width = image.shape[:2]
    rays = _undistorted(K, width, height).reshape(-1, 2)
    found, _ = distortion.pixels(np.column_stack([rays, np.ones(len(rays))]), K)
    where = found.reshape(height, width, 2).astype(np.float32)
    return cv2.remap(image, where[..., 0], where[..., 1], cv2.INTER_LINEAR)


def _remapped(images: Images, where: np.ndarray) -> Images:
    """Nearest pixels: materials, numbers and depths have no means between them."""
    u, v = where[..., 0], where[..., 1]
    found = {
        name: None if array is None else cv2.remap(array, u, v, cv2.INTER_NEAREST)
        for name in ("rgba", "number", "inverse_depth")
        for array in (getattr(images, name),)
    }
    return replace(images, **found)


def _undistorted(K: np.ndarray, width: int, height: int) -> np.ndarray:
    """Normalised coordinates (h, w, 2) of every pixel of the pinhole camera."""
    grid = _grid(width, height)
    return (grid - [K[0, 2], K[1, 2]]) / [K[0, 0], K[1, 1]]


def _grid(width: int, height: int) -> np.ndarray:
    """Pixel coordinates (h, w, 2)."""
    return np.dstack(np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)))
