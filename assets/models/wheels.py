"""Wheels: a tyre with a dished, spoked rim."""

from __future__ import annotations

import numpy as np

from assets.materials import material_index
from assets.mesh import Mesh
from assets.models.catalogue import ModelSpec
from assets.shapes import lathe, mirrored

SEGMENTS = 20


def wheel(radius_m: float, width_m: float, spokes: int = 5, rim: float = 0.66) -> Mesh:
    """Left wheel centred on the origin, axle along y, outer face at +y, one corner straight down.

    Args:
        radius_m: outer radius of the tyre.
        width_m: width of the tyre.
        spokes: number of spokes; must divide the number of segments. 0 gives a closed disc.
        rim: radius of the rim as a share of `radius_m`.
    """
    half, rim_m = width_m / 2, rim * radius_m
    tyre = lathe(
        np.array(
            [
                (0.0, -half + 0.02),
                (radius_m, -half + 0.005),
                (radius_m, half - 0.03),
                (0.90 * radius_m, half),
                (rim_m, half - 0.005),
            ]
        ),
        "tyre", SEGMENTS, "y", -np.pi,
    )  # fmt: skip
    disc = lathe(
        np.array([(rim_m, half - 0.005), (0.92 * rim_m, half - 0.03), (0.25 * rim_m, half - 0.045), (0, half - 0.03)]),
        "wheel_rim", SEGMENTS, "y", -np.pi,
    )  # fmt: skip
    return Mesh.merge([tyre, _with_gaps(disc, spokes, rim_m) if spokes else disc])


def _with_gaps(disc: Mesh, spokes: int, rim_m: float) -> Mesh:
    """The disc with the openings between its spokes darkened."""
    centre = disc.triangles.mean(1)
    turn = np.arctan2(centre[:, 0], centre[:, 2]) / (2 * np.pi) * spokes % 1.0
    radius = np.hypot(centre[:, 0], centre[:, 2])
    gap = (turn > 0.5) & (radius > 0.3 * rim_m) & (radius < 0.93 * rim_m)
    return Mesh(disc.vertices, disc.faces, np.where(gap, material_index("car_trim"), disc.materials))


def four_wheels(spec: ModelSpec, radius_m: float, width_m: float, spokes: int = 5) -> Mesh:
    """A wheel at each end of the front and rear axle, standing on z = 0."""
    left = wheel(radius_m, width_m, spokes)
    parts = [left.moved((x, spec.track_m / 2, radius_m)) for x in (spec.front_axle_x_m, spec.rear_axle_x_m)]
    return Mesh.merge([*parts, *(mirrored(part) for part in parts)])
