"""Mirrors, number plates and door handles."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import Vector, box, ellipsoid, mirrored, quad_strip

PLATE_SIZE_M = (0.52, 0.11)


def number_plate(x_m: float, height_m: float, thickness_m: float = 0.03) -> Mesh:
    """Plate whose face lies at `x_m`, looking away from the vehicle, its middle at `height_m`."""
    way = float(np.sign(x_m))
    width, height = PLATE_SIZE_M
    return box((thickness_m, width, height), (x_m - way * thickness_m / 2, 0, height_m), "number_plate")


def side_mirrors(root: Vector, reach_y_m: float, size: float = 1.0) -> Mesh:
    """A pair of mirrors.

    Args:
        root: (3,) where the left one joins the body.
        reach_y_m: lateral position of its outer end.
        size: scale of the housing's height and depth.
    """
    x, y, z = root
    half = (reach_y_m - y) / 2 + 0.015
    centre = (x + 0.01, reach_y_m - half, z + 0.075 * size)
    housing = ellipsoid((0.085 * size, half, 0.072 * size), centre, "car_paint", 8, 4)
    faces = np.maximum(housing.vertices[:, 0], x - 0.035 * size)  # the back is cut flat for the glass
    housing = Mesh(np.column_stack([faces, housing.vertices[:, 1:]]), housing.faces, housing.materials)
    across = 0.72 * half * np.array([[-1.0, -1.0], [1.0, 1.0]])
    up = 0.048 * size * np.array([[-1.0, 1.0], [-1.0, 1.0]])
    glass = np.stack([np.full((2, 2), x - 0.035 * size - 0.004), centre[1] - across, centre[2] + up], -1)
    left = Mesh.merge([housing, quad_strip(glass, "mirror")])
    return Mesh.merge([left, mirrored(left)])
