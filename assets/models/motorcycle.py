"""Motorcycles with their riders."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.models.catalogue import ModelSpec
from assets.models.figure import Outfit, Pose, figure
from assets.models.fittings import side_mirrors
from assets.shapes import Vector, box, cylinder, ellipsoid, lathe, loft, tube

_RADIUS_M = 0.315
_EXHAUST = [
    (0.30, -0.12, 0.55),
    (0.34, -0.14, 0.33),
    (0.10, -0.17, 0.20),
    (-0.30, -0.19, 0.26),
    (-0.42, -0.20, 0.30),
]
_TANK = [  # sections: x, middle height, half-width, half-height
    (-0.16, 0.76, 0.08, 0.06),
    (-0.08, 0.80, 0.13, 0.09),
    (0.12, 0.84, 0.17, 0.12),
    (0.30, 0.85, 0.16, 0.11),
    (0.40, 0.84, 0.09, 0.07),
]


def build_motorcycle(spec: ModelSpec) -> Mesh:
    """Mesh of a motorcycle with its rider; variant 0 is naked and upright, variant 1 a faired tourer."""
    front, rear = spec.front_axle_x_m, spec.rear_axle_x_m
    faired = spec.variant == 1
    parts = [
        _wheel(0.12).moved((front, 0, _RADIUS_M)),
        _wheel(0.17).moved((rear, 0, _RADIUS_M)),
        _engine(rear),
        _fork(front),
        _tank_and_seat(),
        _tail(spec),
        _rider(faired),
        side_mirrors((0.36, 0.30, 1.08), spec.width_m / 2, 0.7),
    ]
    return Mesh.merge([*parts, _fairing() if faired else _headlamp()])


def _wheel(width: float) -> Mesh:
    half = width / 2
    profile = [(0.20, -half), (0.27, -half), (_RADIUS_M, -0.02), (_RADIUS_M, 0.02), (0.27, half), (0.20, half)]
    tyre = lathe(np.array([*profile, profile[0]]), "tyre", 20, "y", -np.pi)
    hub = lathe(np.array([(0, -half), (0.07, -half), (0.07, half), (0, half)]), "wheel_rim", 8, "y")
    spokes = [
        tube(np.array([[0, 0, 0], [0.21 * np.cos(a), 0, 0.21 * np.sin(a)]]), 0.022, "wheel_rim", 3)
        for a in 2 * np.pi * np.arange(5) / 5
    ]
    disc = cylinder(0.14, 0.006, "steel_galvanised", 8, "y").moved((0, half, 0))
    return Mesh.merge([tyre, hub, disc, *spokes])


def _blob(stations: list[tuple[float, float, float, float]], material: str, segments: int = 10) -> Mesh:
    """Loft along x of rounded sections: x, middle height, half-width, half-height; front last."""
    angle = 2 * np.pi * np.arange(segments) / segments
    c, s = np.cos(angle), np.sin(angle)
    y, z = np.sign(c) * np.abs(c) ** 0.8, np.sign(s) * np.abs(s) ** 0.8
    rings = [
        np.stack([np.full(segments, x), half_width * y, height + half_height * z], 1)
        for x, height, half_width, half_height in stations
    ]
    return loft(np.stack(rings), material)


def _bar(start: Vector, end: Vector, radius: float, material: str) -> Mesh:
    return tube(np.array([start, end], float), radius, material, 6)


def _engine(rear: float) -> Mesh:
    block = _blob(
        [(-0.22, 0.40, 0.13, 0.12), (-0.12, 0.42, 0.19, 0.17), (0.18, 0.42, 0.19, 0.17), (0.26, 0.42, 0.13, 0.11)],
        "wheel_rim",
        8,
    )
    cylinders = box((0.20, 0.34, 0.22), (0.14, 0, 0.64), "car_trim")
    radiator = box((0.05, 0.34, 0.30), (0.33, 0, 0.62), "car_trim")
    frame = [_bar((0.42, 0, 0.92), (-0.25, side * 0.13, 0.62), 0.025, "steel_painted") for side in (-1, 1)]
    swing = [
        _bar((-0.22, side * 0.11, 0.42), (rear, side * 0.11, _RADIUS_M), 0.026, "steel_painted") for side in (-1, 1)
    ]
    exhaust = tube(np.array(_EXHAUST), 0.025, "chrome", 6)
    silencer = _bar((-0.40, -0.20, 0.30), (-0.82, -0.22, 0.42), 0.055, "chrome")
    return Mesh.merge([block, cylinders, radiator, *frame, *swing, exhaust, silencer])


def _fork(front: float) -> Mesh:
    legs = [_bar((front, side * 0.10, _RADIUS_M), (0.42, side * 0.10, 0.98), 0.027, "chrome") for side in (-1, 1)]
    left = np.array([(0.22, 0.37, 0.99), (0.32, 0.30, 1.02), (0.40, 0.10, 1.00), (0.40, 0.0, 1.00)])
    bar = tube(np.concatenate([left, left[-2::-1] * (1, -1, 1)]), 0.015, "car_trim", 6)
    turn = np.radians(np.linspace(20, 150, 7))
    arc = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
    axle = np.array([front, 0, _RADIUS_M])
    outer, inner = axle + 0.345 * arc, axle + 0.335 * arc
    wide = np.array([0, 0.065, 0])
    guard = loft(np.stack([outer - wide, outer + wide, inner + wide, inner - wide], 1), "car_paint")
    return Mesh.merge([*legs, bar, guard])


def _tank_and_seat() -> Mesh:
    tank = _blob(_TANK, "car_paint")
    seat = _blob(
        [
            (-0.78, 0.86, 0.07, 0.03),
            (-0.68, 0.85, 0.12, 0.045),
            (-0.42, 0.82, 0.14, 0.05),
            (-0.30, 0.76, 0.14, 0.05),
            (-0.10, 0.75, 0.10, 0.05),
        ],
        "car_seat",
        8,
    )
    side = _blob(
        [(-0.72, 0.78, 0.05, 0.03), (-0.50, 0.74, 0.12, 0.06), (-0.18, 0.66, 0.14, 0.10), (-0.08, 0.66, 0.09, 0.06)],
        "car_paint",
        8,
    )
    return Mesh.merge([tank, seat, side])


def _tail(spec: ModelSpec) -> Mesh:
    end = -spec.length_m / 2
    lamp = box((0.05, 0.16, 0.06), (-0.80, 0, 0.82), "tail_lamp")
    top = np.array([(-0.78, -0.07, 0.80), (-0.78, 0.07, 0.80), (-0.80, 0.07, 0.78), (-0.80, -0.07, 0.78)])
    foot = np.array([(0.02, -0.07, 0.56), (0.02, 0.07, 0.56), (0.03, 0.07, 0.55), (0.03, -0.07, 0.55)])
    guard = loft(np.stack([top, foot + np.array([end, 0.0, 0.0])]), "plastic_dark")
    plate = box((0.012, 0.20, 0.16), (end + 0.006, 0, 0.58), "number_plate")
    return Mesh.merge([lamp, guard, plate])


def _headlamp() -> Mesh:
    shell = ellipsoid((0.11, 0.10, 0.10), (0.50, 0, 0.90), "car_trim", 8, 6)
    lens = lathe(np.array([(0.085, 0.0), (0.05, 0.02), (0.0, 0.028)]), "headlamp", 10, "x").moved((0.587, 0, 0.90))
    dials = box((0.05, 0.16, 0.07), (0.44, 0, 1.06), "car_trim")
    return Mesh.merge([shell, lens, dials])


def _fairing() -> Mesh:
    """Half-fairing with twin lamps and a screen of clear plastic."""
    shell = _blob(
        [(0.30, 0.80, 0.19, 0.14), (0.46, 0.86, 0.20, 0.16), (0.62, 0.86, 0.15, 0.12), (0.72, 0.84, 0.06, 0.05)],
        "car_paint",
    )
    lamps = [ellipsoid((0.04, 0.05, 0.035), (0.655, side * 0.075, 0.87), "headlamp", 8, 4) for side in (-1, 1)]
    angle = np.radians(np.linspace(-62, 62, 7))
    low = np.stack([0.40 + 0.20 * np.cos(angle), 0.19 * np.sin(angle), np.full(7, 0.96)], 1)
    high = np.stack([0.30 + 0.14 * np.cos(angle), 0.15 * np.sin(angle), 1.24 - 0.05 * np.abs(np.sin(angle))], 1)
    screen = Mesh.of(np.concatenate([low, high]), _strip(7), "car_glass")
    cheeks = [
        _blob(
            [(0.05, 0.50, 0.02, 0.10), (0.20, 0.55, 0.03, 0.18), (0.42, 0.68, 0.03, 0.16), (0.50, 0.74, 0.02, 0.08)],
            "car_paint",
            6,
        ).moved((0, side * 0.20, 0))
        for side in (-1, 1)
    ]
    return Mesh.merge([shell, *lamps, screen, *cheeks])


def _strip(n: int) -> np.ndarray:
    i = np.arange(n - 1)
    return np.concatenate([np.stack([i, i + 1, i + 1 + n], 1), np.stack([i, i + 1 + n, i + n], 1)])


def _rider(faired: bool) -> Mesh:
    lean = 0.06 if faired else 0.0
    outfit = Outfit(top="clothing_dark", legs="clothing_dark", helmet="full")
    return figure(
        Pose(
            pelvis=(-0.33, 0.0, 0.92),
            neck=(-0.10 + lean, 0.0, 1.40 - lean / 2),
            head=(-0.04 + lean, 0.0, 1.55 - lean / 2),
            hands=((0.22, 0.33, 1.02), (0.22, -0.33, 1.02)),
            ankles=((-0.14, 0.21, 0.43), (-0.14, -0.21, 0.43)),
            toes_deg=(-5.0, -5.0),
            elbow_hint=(-0.4, 0.8, -0.6),
            knee_hint=(1.0, 0.25, 0.5),
            outfit=outfit,
        )
    )
