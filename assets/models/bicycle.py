"""Bicycles with their riders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.mesh import Mesh
from assets.models.catalogue import ModelSpec
from assets.models.figure import Outfit, Pose, figure
from assets.shapes import Vector, box, cylinder, loft, tube

_WHEEL_RADIUS_M = 0.34
_TYRE_RADIUS_M = 0.018
_CRANK = np.array([-0.08, 0.0, 0.28])
_CRANK_LENGTH_M = 0.17
_SADDLE = np.array([-0.25, 0.0, 0.96])
_HEAD_LOW, _HEAD_HIGH = np.array([0.40, 0.0, 0.72]), np.array([0.355, 0.0, 0.90])


@dataclass(frozen=True)
class _Ride:
    """Shape of a bicycle and posture of its rider: hands, lean of the rider, crank angle and clothing."""

    hands: Vector
    neck: Vector
    head: Vector
    crank_rad: float
    bar: tuple[Vector, ...]
    outfit: Outfit
    mudguards: bool = False
    rack: bool = False


_RIDES = (
    _Ride(  # a town bicycle, ridden upright
        hands=(0.26, 0.235, 1.09),
        neck=(-0.06, 0.0, 1.47),
        head=(0.0, 0.0, 1.595),
        crank_rad=0.5,
        bar=((0.20, 0.27, 1.07), (0.32, 0.20, 1.08), (0.345, 0.0, 1.05)),
        outfit=Outfit(helmet="cycle"),
        mudguards=True,
        rack=True,
    ),
    _Ride(  # a racing bicycle, ridden low
        hands=(0.46, 0.21, 0.98),
        neck=(0.06, 0.0, 1.44),
        head=(0.16, 0.0, 1.59),
        crank_rad=2.3,
        bar=((0.38, 0.205, 0.86), (0.50, 0.205, 0.90), (0.47, 0.205, 0.98), (0.355, 0.19, 0.985), (0.355, 0.0, 0.985)),
        outfit=Outfit(legs="clothing_dark", sleeves=False, helmet="cycle"),
    ),
    _Ride(  # a touring bicycle with a rider who carries a bag
        hands=(0.34, 0.25, 1.05),
        neck=(0.0, 0.0, 1.43),
        head=(0.08, 0.0, 1.60),
        crank_rad=-1.0,
        bar=((0.31, 0.285, 1.03), (0.36, 0.15, 1.03), (0.355, 0.0, 1.02)),
        outfit=Outfit(backpack=True, helmet="none"),
        mudguards=True,
    ),
)  # fmt: skip


def build_bicycle(spec: ModelSpec) -> Mesh:
    """Mesh of a bicycle with its rider, about 1.76 m long."""
    ride = _RIDES[spec.variant]
    front = np.array([spec.front_axle_x_m, 0.0, _WHEEL_RADIUS_M])
    rear = np.array([spec.rear_axle_x_m, 0.0, _WHEEL_RADIUS_M])
    return Mesh.merge(
        [spoked_wheel().moved(front), spoked_wheel().moved(rear), _frame(front, rear), _bars(ride), _drive(ride)]
        + ([_guards(front), _guards(rear)] if ride.mudguards else [])
        + ([_rack(rear)] if ride.rack else [])
        + [_rider(ride)]
    )


def spoked_wheel(spokes: int = 8, segments: int = 24) -> Mesh:
    """Wheel about the origin in the plane y = 0, a corner straight down."""
    turn = -np.pi / 2 + 2 * np.pi * np.arange(segments) / segments
    ring = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
    tyre = tube(ring * (_WHEEL_RADIUS_M - _TYRE_RADIUS_M), _TYRE_RADIUS_M, "tyre", 4, closed=True)
    parts = [tyre, cylinder(0.022, 0.08, "steel_galvanised", 6, "y").moved((0, -0.04, 0))]
    for k in range(spokes):
        way = ring[round(k * segments / spokes) % segments]
        hub = np.array([0.0, 0.03 if k % 2 else -0.03, 0.0])
        parts.append(tube(np.stack([hub, way * (_WHEEL_RADIUS_M - 0.03)]), 0.003, "steel_galvanised", 3))
    return Mesh.merge(parts)


def _bar(start: Vector, end: Vector, radius: float = 0.016, material: str = "steel_painted") -> Mesh:
    return tube(np.array([start, end], float), radius, material, 6)


def _frame(front: np.ndarray, rear: np.ndarray) -> Mesh:
    seat = _SADDLE - (-0.03, 0, 0.16)
    parts = [
        _bar(_HEAD_HIGH - (0, 0, 0.05), seat),
        _bar(_HEAD_LOW, _CRANK, 0.019),
        _bar(_CRANK, _SADDLE - (0, 0, 0.05)),
        _bar(_HEAD_LOW, _HEAD_HIGH, 0.019),
    ]
    for side in (-1, 1):
        drop = np.array([0.0, side * 0.055, 0.0])
        parts += [_bar(_CRANK, rear + drop, 0.010), _bar(seat, rear + drop, 0.009)]
        parts.append(_bar(_HEAD_LOW + 0.6 * drop, front + drop, 0.013))
    half = np.array([(-0.13, 0.085), (0.0, 0.03), (0.14, 0.018)])
    outline = np.concatenate([half * (1, -1), half[::-1], [(-0.14, 0.0)]])
    rings = [
        np.column_stack([outline * size, np.full(len(outline), height)])
        for size, height in ((0.75, -0.05), (1.0, -0.01), (0.9, 0.01))
    ]
    return Mesh.merge([*parts, loft(np.stack(rings), "car_trim").moved(_SADDLE)])


def _bars(ride: _Ride) -> Mesh:
    left = np.array(ride.bar, float)
    path = np.concatenate([left, left[-2::-1] * (1, -1, 1)])
    stem = _bar(_HEAD_HIGH, left[-1], 0.014, "steel_galvanised")
    lamp = box((0.05, 0.05, 0.05), _HEAD_HIGH + np.array([0.05, 0, 0.03]), "headlamp")
    return Mesh.merge([tube(path, 0.014, "car_trim", 6), stem, lamp])


def _pedals(ride: _Ride) -> tuple[np.ndarray, np.ndarray]:
    reach = _CRANK_LENGTH_M * np.array([np.cos(ride.crank_rad), 0.0, np.sin(ride.crank_rad)])
    return _CRANK + reach + (0, 0.12, 0), _CRANK - reach - (0, 0.12, 0)


def _drive(ride: _Ride) -> Mesh:
    parts = [cylinder(0.095, 0.006, "steel_galvanised", 12, "y").moved(_CRANK + np.array([0, -0.065, 0]))]
    for side, pedal in zip((1, -1), _pedals(ride), strict=True):
        axle = np.array([0, side * 0.07, 0])
        parts.append(_bar(_CRANK + axle, pedal * (1, 0, 1) + axle, 0.011, "steel_galvanised"))
        parts.append(box((0.09, 0.09, 0.02), pedal, "plastic_dark"))
    return Mesh.merge(parts)


def _guards(axle: np.ndarray) -> Mesh:
    """Mudguard over the upper rear of a wheel, and its reflector."""
    turn = np.radians(np.linspace(60, 190, 8))
    radius = _WHEEL_RADIUS_M - 0.002
    rim = axle + radius * np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
    inner = axle + (radius - 0.004) * np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
    wide = np.array([0, 0.028, 0])
    return loft(np.stack([rim - wide, rim + wide, inner + wide, inner - wide], 1), "plastic_dark")


def _rack(rear: np.ndarray) -> Mesh:
    top = rear + np.array([0.0, 0.0, 0.40])
    lamp = box((0.03, 0.08, 0.04), top + np.array([-0.19, 0, 0.0]), "tail_lamp")
    legs = [_bar(rear + np.array([0, side, 0]), top + np.array([-0.05, side, 0]), 0.006) for side in (-0.06, 0.06)]
    return Mesh.merge([box((0.36, 0.13, 0.02), top, "steel_painted"), lamp, *legs])


def _rider(ride: _Ride) -> Mesh:
    left, right = _pedals(ride)
    ankle = np.array([-0.09, 0.0, 0.10])
    hand = np.asarray(ride.hands, float)
    return figure(
        Pose(
            pelvis=_SADDLE + np.array([-0.02, 0, 0.10]),
            neck=ride.neck,
            head=ride.head,
            hands=(hand, hand * (1, -1, 1)),
            ankles=(left + ankle, right + ankle),
            toes_deg=(-8.0, -14.0),
            elbow_hint=(-0.3, 0.45, -1.0),
            outfit=ride.outfit,
        )
    )
