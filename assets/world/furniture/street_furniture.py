"""Street furniture templates: origin at the foot, x along the street in traffic direction, y towards the road.

Each function returns one model in metres, z up.
"""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box, cone, cylinder, extrude, tube

Seat = tuple[float, float, float]
"""Position of the hips of a sitting person: x, y in the template's axes [m], and the direction of view [°]."""

BENCH_SEATS: tuple[Seat, ...] = ((-0.58, -0.08, 90.0), (0.0, -0.08, 90.0), (0.58, -0.08, 90.0))
SHELTER_SEATS: tuple[Seat, ...] = tuple((x, -0.46, 90.0) for x in (-1.2, -0.6, 0.0, 0.6))


def pole(radius_m: float, top_radius_m: float, height_m: float, material: str, segments: int = 6) -> Mesh:
    """An upright tapered pole without a bottom."""
    closed = cone(radius_m, top_radius_m, height_m, material, segments)
    return closed.select(closed.normals[:, 2] > -0.9)


def street_lamp(height_m: float, arm_m: float) -> Mesh:
    """Tapered pole with an arm over the road and a flat luminaire."""
    mast = pole(0.09, 0.05, height_m, "steel_galvanised", segments=5)
    path = np.array([[0, 0, height_m - 0.1], [0, arm_m * 0.5, height_m + 0.25], [0, arm_m, height_m + 0.3]])
    arm = tube(path, 0.035, "steel_galvanised", segments=3)
    head = box((0.22, 0.7, 0.12), (0, arm_m + 0.2, height_m + 0.28), "steel_painted")
    glow = box((0.18, 0.5, 0.03), (0, arm_m + 0.2, height_m + 0.205), "plastic_bright")
    return Mesh.merge([mast, arm, head, glow])


def bollard() -> Mesh:
    """Steel post with a reflecting collar."""
    post = pole(0.07, 0.06, 0.9, "steel_painted")
    collar = pole(0.075, 0.075, 0.08, "sign_face").moved((0, 0, 0.72))
    return Mesh.merge([post, collar])


def litter_bin() -> Mesh:
    """Round bin on a foot with a lid."""
    body = pole(0.19, 0.23, 0.65, "steel_painted", segments=8).moved((0, 0, 0.15))
    lid = pole(0.25, 0.10, 0.14, "plastic_dark", segments=8).moved((0, 0, 0.82))
    return Mesh.merge([pole(0.05, 0.05, 0.15, "steel_painted", 4), body, lid])


def wheelie_bin() -> Mesh:
    """Household refuse bin with a sloping lid."""
    side = np.array([[-0.25, 0.05], [0.22, 0.05], [0.29, 0.95], [0.27, 1.02], [-0.30, 1.07]])
    body = extrude(side[:, ::-1], 0.52, "plastic_dark", axis="y")
    return Mesh.merge([body.moved((0, -0.26, 0)), cylinder(0.1, 0.5, "tyre", 8, "y").moved((-0.2, -0.25, 0.1))])


def bench() -> Mesh:
    """Slatted bench that faces the road."""
    parts = [box((1.7, 0.10, 0.04), (0, y, 0.45), "wood") for y in (-0.18, -0.04, 0.10, 0.22)]
    parts += [box((1.7, 0.03, 0.10), (0, -0.26 - 0.05 * k, 0.6 + 0.16 * k), "wood") for k in range(2)]
    for x in (-0.65, 0.65):
        parts.append(box((0.06, 0.46, 0.43), (x, 0.0, 0.215), "steel_painted"))
        parts.append(box((0.06, 0.05, 0.45), (x, -0.31, 0.6), "steel_painted"))
    return Mesh.merge(parts)


def hydrant() -> Mesh:
    """Above-ground fire hydrant with two outlets."""
    body = pole(0.13, 0.11, 0.65, "plastic_bright", segments=8)
    cap = pole(0.14, 0.04, 0.15, "plastic_bright", segments=8).moved((0, 0, 0.65))
    outlet = cylinder(0.055, 0.4, "steel_galvanised", 6, "x").moved((-0.2, 0, 0.5))
    return Mesh.merge([body, cap, outlet])


def cabinet(width_m: float) -> Mesh:
    """Distribution cabinet on a concrete foot."""
    body = box((width_m, 0.35, 1.1), (0, 0, 0.67), "steel_painted")
    roof = box((width_m + 0.06, 0.42, 0.05), (0, 0, 1.245), "plastic_dark")
    return Mesh.merge([box((width_m, 0.38, 0.12), (0, 0, 0.06), "concrete"), body, roof])


def bus_shelter() -> Mesh:
    """Glazed shelter 3.6 m long, open towards the road, with a bench and a lit poster."""
    parts = [box((3.8, 1.6, 0.10), (0, -0.1, 2.45), "steel_painted")]
    for x in (-1.8, 0.0, 1.8):
        parts.append(box((0.07, 0.07, 2.4), (x, -0.7, 1.2), "steel_painted"))
    parts += [box((0.07, 0.07, 2.4), (x, 0.45, 1.2), "steel_painted") for x in (-1.8, 1.8)]
    parts += [box((1.66, 0.012, 1.9), (x, -0.7, 1.2), "window_glass") for x in (-0.9, 0.9)]
    parts.append(box((0.012, 1.05, 1.9), (-1.8, -0.13, 1.2), "window_glass"))
    parts.append(box((0.12, 1.0, 1.8), (1.8, -0.13, 1.15), "plastic_bright"))
    parts.append(box((2.4, 0.35, 0.05), (-0.3, -0.45, 0.47), "wood"))
    parts += [box((0.05, 0.3, 0.45), (x, -0.45, 0.225), "steel_painted") for x in (-1.3, 0.7)]
    return Mesh.merge(parts)


def parking_meter() -> Mesh:
    """Ticket machine on a post."""
    post = pole(0.04, 0.04, 1.05, "steel_galvanised")
    return Mesh.merge([post, box((0.22, 0.18, 0.38), (0, 0, 1.2), "steel_painted")])
