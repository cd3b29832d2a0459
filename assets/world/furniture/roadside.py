"""Templates of roadside objects: trailers, skips, barriers, scooters, utility poles.

Origin at the foot, x along the street in traffic direction, y towards the road; metres, z up.
"""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box, cylinder, extrude, tube
from assets.world.furniture.street_furniture import pole

_INSULATORS_M = (-0.65, -0.3, 0.3, 0.65)  # across the line


def trailer(rng: np.random.Generator) -> Mesh:
    """A car's trailer on two wheels and its drawbar: open, under a tarpaulin, or a box."""
    length, width = float(rng.uniform(1.9, 3.2)), float(rng.uniform(1.2, 1.6))
    floor, rim = 0.55, float(rng.uniform(0.3, 0.45))
    kind = str(rng.choice(["open", "tarpaulin", "box"]))
    parts = [box((length, width, 0.08), (0, 0, floor), "wood")]
    if kind == "open":
        for y in (-width / 2, width / 2):
            parts.append(box((length, 0.03, rim), (0, y, floor + rim / 2), "steel_galvanised"))
        for x in (-length / 2, length / 2):
            parts.append(box((0.03, width, rim), (x, 0, floor + rim / 2), "steel_galvanised"))
    else:
        tall = float(rng.uniform(0.5, 1.4))
        cover = "tarpaulin" if kind == "tarpaulin" else "cladding_metal"
        parts.append(box((length, width, tall), (0, 0, floor + 0.04 + tall / 2), cover))
    ahead = length / 2 + 1.1
    for y in (-0.35 * width, 0.35 * width):
        parts.append(_beam((length / 2 - 0.1, y, floor - 0.08), (ahead, 0.0, floor - 0.1)))
    parts.append(_beam((ahead - 0.15, 0.0, floor - 0.1), (ahead - 0.15, 0.0, 0.0)))
    for y in (-width / 2 - 0.18, width / 2 + 0.02):
        parts.append(cylinder(0.29, 0.16, "tyre", 10, "y").moved((-0.15, y, 0.29)))
    return Mesh.merge(parts)


def skip(rng: np.random.Generator) -> Mesh:
    """An open container with sloping ends, heaped with rubble."""
    length, width, tall = float(rng.uniform(2.8, 3.6)), float(rng.uniform(1.5, 1.8)), float(rng.uniform(1.0, 1.4))
    half = length / 2
    side = np.array([[-0.6 * half, 0.0], [0.6 * half, 0.0], [half, tall], [-half, tall]])
    body = extrude(side[:, ::-1], width, "steel_painted", axis="y").moved((0, -width / 2, 0))
    heap = [
        box(rng.uniform(0.4, 1.0, 3) * [1.0, 1.0, 0.6], (x, rng.uniform(-0.3, 0.3), tall), material)
        for x, material in zip(np.linspace(-0.6, 0.6, 4) * half, ("concrete", "wood", "brick", "soil"), strict=True)
    ]
    return Mesh.merge([body, *heap])


def barrier(rng: np.random.Generator) -> Mesh:
    """Two to four boards of a building site between posts on rubber feet, and two cones."""
    count, board = int(rng.integers(2, 5)), 1.9
    parts = []
    for k in range(count + 1):
        x = (k - count / 2) * board
        parts.append(box((0.30, 0.60, 0.12), (x, 0, 0.06), "plastic_dark"))
        parts.append(pole(0.03, 0.03, 1.15, "steel_galvanised", 4).moved((x, 0, 0)))
    for k in range(count):
        x = (k + 0.5 - count / 2) * board
        parts += [box((board - 0.06, 0.03, tall), (x, 0, z), "sign_red") for z, tall in ((0.98, 0.22), (0.25, 0.12))]
    for x in rng.uniform(-count * board / 2, count * board / 2, 2):
        parts.append(pole(0.17, 0.03, 0.62, "plastic_bright", 8).moved((x, 0.15, 0)))
    return Mesh.merge(parts)


def scooter(rng: np.random.Generator) -> Mesh:
    """A parked motor scooter or light motorcycle."""
    skin = str(rng.choice(["steel_painted", "plastic_bright", "plaster_red", "plastic_dark"]))
    parts = [cylinder(0.25, 0.11, "tyre", 10, "y").moved((x, -0.055, 0.25)) for x in (-0.62, 0.62)]
    parts.append(box((0.75, 0.32, 0.42), (-0.42, 0, 0.55), skin))
    parts.append(box((0.62, 0.27, 0.11), (-0.40, 0, 0.80), "plastic_dark"))
    parts.append(box((0.50, 0.30, 0.07), (0.12, 0, 0.32), skin))
    parts.append(tube(np.array([[0.62, 0, 0.25], [0.42, 0, 0.98]]), 0.035, "steel_galvanised", 4))
    parts.append(box((0.06, 0.42, 0.62), (0.47, 0, 0.66), skin))
    parts.append(box((0.05, 0.66, 0.05), (0.40, 0, 1.02), "plastic_dark"))
    if rng.random() < 0.4:
        parts.append(box((0.36, 0.38, 0.32), (-0.82, 0, 0.98), "plastic_dark"))
    return Mesh.merge(parts)


def utility_pole(rng: np.random.Generator) -> Mesh:
    """A wooden pole of a telephone or power line, with a crossarm and its insulators."""
    tall = float(rng.uniform(7.0, 9.5))
    parts = [pole(0.15, 0.10, tall, "wood", 7), box((0.10, 1.5, 0.10), (0, 0, tall - 0.45), "wood")]
    parts += [pole(0.04, 0.03, 0.16, "plastic_dark", 5).moved((0, y, tall - 0.4)) for y in _INSULATORS_M]
    return Mesh.merge(parts)


def insulators(utility_pole: Mesh) -> np.ndarray:
    """Upper ends (4, 3) of a utility pole's insulators [m]."""
    top = float(utility_pole.bounds[1, 2]) - 0.24
    return np.array([[0.0, y, top] for y in _INSULATORS_M])


def advertising_pillar() -> Mesh:
    """A round pillar for posters under a flat cone."""
    body = pole(0.62, 0.62, 2.7, "plaster_yellow", 14)
    roof = pole(0.75, 0.10, 0.45, "steel_painted", 14).moved((0, 0, 2.7))
    return Mesh.merge([pole(0.68, 0.68, 0.25, "concrete", 14), body, roof])


def glass_banks(rng: np.random.Generator) -> Mesh:
    """Two or three round-shouldered containers for glass or clothes in a row."""
    count = int(rng.integers(2, 4))
    side = np.array([[-0.6, 0.05], [0.6, 0.05], [0.68, 0.9], [0.45, 1.55], [-0.45, 1.55], [-0.68, 0.9]])
    one = extrude(side[:, ::-1], 1.1, str(rng.choice(["steel_painted", "plaster_white"])), axis="y")
    return Mesh.merge([one.moved(((k - (count - 1) / 2) * 1.5, -0.55, 0)) for k in range(count)])


def _beam(start: tuple[float, float, float], end: tuple[float, float, float]) -> Mesh:
    return tube(np.array([start, end]), 0.035, "steel_galvanised", 4)
