"""Templates of what people put on pavements: tables, boxes, tubs, bicycles, stalls, guard rails.

Origin at the foot, x along the street in traffic direction, y towards the road; metres, z up. Thin parts are single
sheets, seen from both sides.
"""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box, cylinder
from assets.world.furniture.street_furniture import Seat, pole
from assets.world.plants.trees import bush

TABLE_SEATS: tuple[Seat, ...] = ((0.70, 0.0, 180.0), (-0.70, 0.0, 0.0))
_WHEEL_M = 0.33
_WHEEL_CORNERS = 12


def cafe_table() -> Mesh:
    """A round table between two chairs."""
    top = cylinder(0.36, 0.03, "wood", 8).moved((0, 0, 0.72))
    foot = pole(0.22, 0.04, 0.04, "steel_painted", 6)
    parts = [top, foot, pole(0.035, 0.035, 0.72, "steel_painted", 4)]
    for side in (-1.0, 1.0):
        parts.append(box((0.42, 0.42, 0.04), (0.68 * side, 0, 0.45), "wood"))
        parts.append(_sheet((0.87 * side, -0.20, 0.47), (0, 0.4, 0), (0, 0, 0.42), "wood"))
        for y in (-0.19, 0.19):
            parts += [_sheet((x * side - 0.02, y, 0), (0.04, 0, 0), (0, 0, 0.43), "steel_painted") for x in (0.5, 0.86)]
    return Mesh.merge(parts)


def boxes(rng: np.random.Generator) -> Mesh:
    """Two to four cardboard boxes or crates, the last on top of the first."""
    sizes = rng.uniform((0.3, 0.3, 0.2), (0.6, 0.45, 0.5), (int(rng.integers(2, 5)), 3))
    material = str(rng.choice(["wood", "plastic_dark", "plastic_bright", "cargo_box"]))
    parts, x = [], 0.0
    for size in sizes[:-1]:
        parts.append(box(size, (x + size[0] / 2, rng.uniform(-0.05, 0.05), size[2] / 2), material))
        x += size[0] + 0.03
    top = np.minimum(sizes[-1], sizes[0])
    parts.append(box(top, (sizes[0][0] / 2, 0, sizes[0][2] + top[2] / 2), material))
    return Mesh.merge(parts).moved((-x / 2, 0, 0))


def planter(rng: np.random.Generator) -> Mesh:
    """A concrete tub with a bush."""
    height = float(rng.uniform(0.35, 0.55))
    tub = pole(0.28, 0.36, height, "concrete", 8)
    return Mesh.merge([tub, bush(rng, float(rng.uniform(0.6, 1.1)), 0.38).moved((0, 0, height - 0.12))])


def parked_bicycle(rng: np.random.Generator) -> Mesh:
    """A parked bicycle, leaning slightly."""
    metal = str(rng.choice(["steel_painted", "steel_galvanised", "plastic_bright", "chrome"]))
    rear, front, crank = np.array([-0.52, 0, _WHEEL_M]), np.array([0.52, 0, _WHEEL_M]), np.array([-0.07, 0, 0.28])
    saddle, head, bar = np.array([-0.22, 0, 0.88]), np.array([0.36, 0, 0.80]), np.array([0.32, 0, 1.02])
    pairs = ((rear, crank), (rear, saddle), (crank, saddle), (crank, head), (saddle, head), (front, bar))
    parts = [_wheel(rear), _wheel(front), *(_bar(a, b, 0.02, metal) for a, b in pairs)]
    parts.append(box((0.26, 0.15, 0.06), (-0.25, 0, 0.93), "plastic_dark"))
    parts.append(box((0.04, 0.56, 0.03), bar + np.array([0, 0, 0.02]), "steel_galvanised"))
    lean = np.eye(4)
    lean[1, 2] = 0.09
    return Mesh.merge(parts).transformed(lean)


def guard_rail() -> Mesh:
    """Four metres of railing between pavement and road."""
    posts = [pole(0.03, 0.03, 1.0, "steel_galvanised", 4).moved((x, 0, 0)) for x in (-2.0, 0.0, 2.0)]
    return Mesh.merge([*posts, *(box((4.0, 0.04, 0.05), (0, 0, z), "steel_galvanised") for z in (0.5, 0.98))])


def market_stall(rng: np.random.Generator) -> Mesh:
    """A counter with crates of goods under an awning."""
    cloth = str(rng.choice(["plaster_red", "plaster_white", "plastic_bright", "plaster_yellow"]))
    parts = [box((2.2, 0.8, 0.06), (0, 0, 0.82), "wood"), _sheet((-1.1, 0.4, 0.1), (2.2, 0, 0), (0, 0, 0.7), cloth)]
    for x in (-1.1, 1.1):
        parts += [box((0.05, 0.05, z), (x, y, z / 2), "wood") for y, z in ((-0.5, 2.05), (0.5, 2.25))]
    parts.append(_sheet((-1.3, -0.7, 2.0), (2.6, 0, 0), (0, 1.35, 0.29), cloth))
    parts.append(_sheet((-1.3, 0.65, 2.04), (2.6, 0, 0), (0, 0, 0.25), cloth))
    for x in np.arange(-0.85, 0.9, 0.42):
        goods = str(rng.choice(["plastic_bright", "foliage", "plaster_red", "plaster_yellow", "wood"]))
        parts.append(box((0.36, 0.5, 0.16), (x, rng.uniform(-0.1, 0.1), 0.93), goods))
    return Mesh.merge(parts)


def _wheel(hub: np.ndarray) -> Mesh:
    """A tyre as a flat ring in the plane of x and z."""
    angle = 2 * np.pi * np.arange(_WHEEL_CORNERS) / _WHEEL_CORNERS
    rim = np.stack([np.cos(angle), np.zeros(_WHEEL_CORNERS), np.sin(angle)], axis=1)
    points = np.concatenate([hub + radius * rim for radius in (_WHEEL_M - 0.04, _WHEEL_M)])
    k = np.arange(_WHEEL_CORNERS)
    m = (k + 1) % _WHEEL_CORNERS
    n = _WHEEL_CORNERS
    faces = np.concatenate([np.stack([k, k + n, m + n], 1), np.stack([k, m + n, m], 1)])
    return Mesh.of(points, faces, "tyre")


def _bar(start: np.ndarray, end: np.ndarray, radius_m: float, material: str) -> Mesh:
    """A tube of a frame as two crossed sheets."""
    along = end - start
    across = np.cross(along, [0.0, 1.0, 0.0])
    across *= 2 * radius_m / np.linalg.norm(across)
    aside = np.array([0.0, 2 * radius_m, 0.0])
    return Mesh.merge([_sheet(start - side / 2, along, side, material) for side in (across, aside)])


def _sheet(corner, along, across, material: str) -> Mesh:
    """A parallelogram of two triangles."""
    corner, along, across = (np.asarray(v, np.float64) for v in (corner, along, across))
    points = np.stack([corner, corner + along, corner + along + across, corner + across])
    return Mesh.of(points, np.array([[0, 1, 2], [0, 2, 3]]), material)
