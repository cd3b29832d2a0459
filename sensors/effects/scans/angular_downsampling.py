"""A denser scan thinned to the resolution of another sensor."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from sensors.cameras.kitti_rig import HEIGHT_PX, KITTI_CALIBRATION, WIDTH_PX
from sensors.effects.base import ScanEffect, number
from sensors.effects.phases import Phase
from sensors.returns import Returns
from sensors.shot import Shot


class AngularDownsampling(ScanEffect):
    """Keep only the return nearest to the centre of each cell of azimuth and elevation.

    With the field `image` only points in the camera's image are kept; without a camera KITTI's calibration is used.
    """

    name: ClassVar = "angular_downsampling"
    phase: ClassVar = Phase.DOWNSAMPLING
    channel: ClassVar = "drop"
    equation: ClassVar = "one return a cell of Δaz × Δel"
    reference: ClassVar = "Synth It Like KITTI, arXiv:2502.15076, published code: 0.16° × 0.30°, image frustum"
    confusable_with: ClassVar = ("random_dropout",)
    example: ClassVar = {"azimuth_deg": 0.4, "elevation_deg": 0.8, "field": "all"}
    is_candidate: ClassVar = False

    azimuth_deg: float = number("Δaz, width of a cell", unit="°", ge=0.01, le=10)
    elevation_deg: float = number("Δel, height of a cell", unit="°", ge=0.01, le=10)
    field: Literal["all", "image"] = Field(description="whether returns outside the image are kept")

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns that are kept."""
        if self.field == "image":
            returns = returns.take(_in_image(returns, shot))
        x, y, z = shot.rays.direction.take(returns.beam, axis=0).astype(np.float64).T
        across = np.degrees(np.arctan2(y, x)) / self.azimuth_deg
        along = np.degrees(np.arcsin(np.clip(z, -1, 1))) / self.elevation_deg
        column, row = np.floor(across).astype(np.int64), np.floor(along).astype(np.int64)
        off = (across - column - 0.5) ** 2 + (along - row - 0.5) ** 2
        cell = row * 2**32 + column
        order = np.lexsort((off, cell))
        first = np.ones(len(order), bool)
        first[1:] = np.diff(cell[order]) != 0
        return returns.take(np.sort(order[first]))


def _in_image(returns: Returns, shot: Shot) -> np.ndarray:
    """(m,) bool: whether the reported points fall into the image."""
    direction = shot.rays.direction.take(returns.beam, axis=0)
    points = shot.rays.origin.take(returns.beam, axis=0) + direction * returns.range_m[:, None]
    if shot.camera is not None:
        pose = shot.hits.pose
        world = points.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        u, v, depth = shot.camera.pixels(world)
        height, width = shot.camera.gray.shape
    else:
        calibration = KITTI_CALIBRATION
        matrix = calibration.P0[:, :3] @ calibration.Tr_velo_to_cam
        matrix[:, 3] += calibration.P0[:, 3]
        projected = points @ matrix[:, :3].T.astype(np.float32) + matrix[:, 3].astype(np.float32)
        depth = projected[:, 2]
        u, v = (projected[:, :2] / np.where(depth > 0, depth, np.float32(np.inf))[:, None]).T
        height, width = HEIGHT_PX, WIDTH_PX
    return (depth > 0) & (u >= 0) & (v >= 0) & (u <= width - 1) & (v <= height - 1)
