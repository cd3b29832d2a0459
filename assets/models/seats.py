"""Seats and the steering wheel; the origin of a seat is on the floor plane below its hip point."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box, extrude, loft, rotation, tube


def _cushion(width: float, depth: float, thickness: float, bulge: float, material: str) -> Mesh:
    """Upholstered slab about the origin, softened at its edges: width along y, depth along z."""
    levels = np.array([-0.5, 0.3, 0.5])
    swell = np.array([1.0, 1.0, 1 - 2 * bulge])
    corners = np.array([(0.5, -0.38), (0.5, 0.38), (0.3, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.3, -0.5)])
    rings = np.empty((3, 6, 3))
    rings[..., :2] = corners * (thickness, width) * swell[:, None, None]
    rings[..., 2] = levels[:, None] * depth
    return loft(rings, material)


def _backrest(width: float, height: float, scale: float) -> Mesh:
    return _cushion(width, height * scale, 0.13, 0.12, "car_seat")


def _headrest(width: float) -> Mesh:
    return _cushion(width, 0.16, 0.09, 0.15, "car_seat")


def seat(sit_m: float, scale: float = 1.0, width_m: float = 0.46) -> Mesh:
    """One seat facing +x with its cushion at `sit_m` above the floor plane's z = 0."""
    lean = rotation("y", np.radians(-17), (-0.14, 0, sit_m))
    back = Mesh.merge(
        [
            _backrest(width_m, 0.58, scale).moved((0, 0, 0.33 * scale)),
            _headrest(0.26).moved((0.02, 0, 0.74 * scale)),
        ]
    ).transformed(lean)
    cushion = box((0.50, width_m, 0.14), (0.12, 0, sit_m - 0.07), "car_seat")
    return Mesh.merge([cushion, back])


def bench(sit_m: float, width_m: float, scale: float = 1.0, seats: int = 3) -> Mesh:
    """A bench across the vehicle with one headrest a place."""
    lean = rotation("y", np.radians(-20), (-0.12, 0, sit_m))
    pitch = width_m / seats
    heads = [
        _headrest(0.24).moved((0.0, (position - (seats - 1) / 2) * pitch, 0.70 * scale)) for position in range(seats)
    ]
    back = Mesh.merge([_backrest(width_m, 0.56, scale).moved((0, 0, 0.32 * scale)), *heads]).transformed(lean)
    return Mesh.merge([box((0.48, width_m, 0.14), (0.13, 0, sit_m - 0.07), "car_seat"), back])


def steering_wheel(radius_m: float = 0.18, tilt_deg: float = 62.0) -> Mesh:
    """Rim, spoke and column about the origin, facing a driver who looks along +x; a tilt of 0 lies flat."""
    turn = 2 * np.pi * np.arange(9) / 9
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], 1) * radius_m
    rim = tube(ring, 0.016, "car_trim", 3, closed=True)
    spoke = box((0.04, 2 * radius_m, 0.02), (0, 0, -0.01), "car_trim")
    column = box((0.06, 0.06, 0.20), (0, 0, -0.11), "car_trim")
    return Mesh.merge([rim, spoke, column]).transformed(rotation("y", -np.radians(tilt_deg)))


def plain_seat(width_m: float, sit_m: float = 0.45) -> Mesh:
    """Hard seat of a bus on its pedestal, facing +x, standing on z = 0 below its hip point."""
    section = np.array(  # z, x
        [
            (sit_m - 0.06, 0.24),
            (sit_m, 0.25),
            (sit_m, -0.12),
            (sit_m + 0.62, -0.26),
            (sit_m + 0.62, -0.31),
            (sit_m - 0.06, -0.19),
        ]
    )
    shell = extrude(section, width_m, "car_seat", axis="y").moved((0, -width_m / 2, 0))
    return Mesh.merge([shell, box((0.10, 0.10, sit_m - 0.06), (0, 0, (sit_m - 0.06) / 2), "steel_galvanised")])
