"""Rigid trucks: a glazed cab and a box or a tarpaulin body on an open chassis."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.models.box_body import BoxBody, Window, box_skin, hanging_mirrors
from assets.models.catalogue import ModelSpec
from assets.models.fittings import number_plate
from assets.models.seats import seat, steering_wheel
from assets.models.wheels import wheel
from assets.shapes import box, cylinder, loft, mirrored, tube

_WHEEL_RADIUS_M = 0.48
_TYRE_WIDTH_M = 0.29
_NOSE_GAP_M = 0.10  # the mirrors reach this far ahead of the windscreen
_CAB_LENGTH_M = 2.05
_CAB_FLOOR_M = 1.10
_BED_M = 1.10  # underside of the load
# height, inset of the flanks, inset of the ends
_CAB_LEVELS = (
    (0.36, 0.03, 0.04),
    (0.62, 0.0, 0.0),
    (0.86, 0.0, 0.01),
    (1.12, 0.0, 0.02),
    (1.50, 0.01, 0.04),
    (2.22, 0.05, 0.16),
    (2.46, 0.08, 0.24),
    (2.62, 0.20, 0.40),
)
_GLASS = (4, 5)


def build_truck(spec: ModelSpec) -> Mesh:
    """Mesh of a truck; variant 0 carries a box, variant 1 a tarpaulin body."""
    front = spec.length_m / 2 - _NOSE_GAP_M
    load_start = front - _CAB_LENGTH_M - 0.18
    load = _box_load if spec.variant == 0 else _tarpaulin_load
    return Mesh.merge(
        [
            *_cab(spec, front),
            load(load_start, -spec.length_m / 2 + 0.02, spec.width_m, spec.height_m),
            *_chassis(spec, load_start),
            *_wheels(spec),
            *_rear(spec),
            hanging_mirrors((spec.length_m / 2, spec.width_m / 2 - 0.01, 2.25), arm_m=0.45),
        ]
    )


def _cab(spec: ModelSpec, front: float) -> list[Mesh]:
    half = spec.width_m / 2 - 0.06
    body = BoxBody(
        front_x=front,
        length=_CAB_LENGTH_M,
        half_width=half,
        levels=_CAB_LEVELS,
        roof_m=2.70,
        axles=[front - spec.front_axle_x_m],
        arch=(_WHEEL_RADIUS_M + 0.07, 2 * _WHEEL_RADIUS_M + 0.09),
        nose=(0.32, 3.2),
        tail=(0.15, 4.0),
        windows=(
            Window((0.0, 0.30), _GLASS),
            Window((0.42, 1.48), _GLASS),
            Window((0.0, _CAB_LENGTH_M), (0, 1), material="car_trim"),
            Window((0.0, 0.06), (2, 3), material="car_trim"),
            Window((0.06, 0.16), (1, 2), material="headlamp"),
        ),
        well_y=spec.track_m / 2 - 0.25,
        spread=4,
    )
    skin = box_skin(body)
    width = 2 * half - 0.12
    middle = front - _CAB_LENGTH_M / 2
    parts = [
        skin.whole(),
        skin.lining(0.25, _CAB_LENGTH_M - 0.001, 0.04),
        box((_CAB_LENGTH_M - 0.30, width, 0.04), (middle, 0, _CAB_FLOOR_M), "car_interior"),
        box((0.45, width, 0.42), (front - 0.42, 0, _CAB_FLOOR_M + 0.18), "car_interior"),
        number_plate(front + 0.008, 0.50, 0.07),
    ]
    hip = front - 1.25
    for y in (-0.62, 0.62):
        parts.append(seat(_CAB_FLOOR_M + 0.42, 1.05, 0.50).moved((hip, y, 0)))
    parts.append(steering_wheel(0.22, 35.0).moved((hip + 0.45, 0.62, _CAB_FLOOR_M + 0.68)))
    if spec.variant == 1:
        parts.append(_deflector(front, half, min(spec.height_m - 0.08, 3.25)))
    return parts


def _deflector(front: float, half: float, top: float) -> Mesh:
    """Wind deflector on the roof of the cab."""
    rings = []
    stations = ((1.95, 0.86, top), (1.60, 0.86, top), (0.95, 0.80, 0.5 * (2.65 + top)), (0.55, 0.70, 2.64))
    for back, width, height in stations:
        y = width * half * np.array([1.0, 0.88, -0.88, -1.0, -1.0, 1.0])
        z = np.array([height - 0.10, height, height, height - 0.10, 2.50, 2.50])
        rings.append(np.stack([np.full(6, front - back), y, np.maximum(z, 2.50)], 1))
    return loft(np.stack(rings), "car_paint")


def _box_load(start: float, end: float, width: float, height: float) -> Mesh:
    """Plain box with a frame of rails round its edges and the refrigerator on its front."""
    length, middle = start - end, (start + end) / 2
    body = box((length - 0.04, width - 0.02, height - _BED_M - 0.06), (middle, 0, (height + _BED_M) / 2), "cargo_box")
    rails = [box((length, width, 0.08), (middle, 0, z), "steel_galvanised") for z in (_BED_M + 0.04, height - 0.04)]
    posts = [
        box((0.06, 0.06, height - _BED_M - 0.16), (x, y, (height + _BED_M) / 2), "steel_galvanised")
        for x in (start - 0.03, end + 0.03)
        for y in (-width / 2 + 0.03, width / 2 - 0.03)
    ]
    locking = np.array([(end - 0.004, 0.35, _BED_M + 0.1), (end - 0.004, 0.35, height - 0.1)])
    bars = [tube(locking * (1, side, 1), 0.014, "chrome", 6) for side in (-1, 1)]
    return Mesh.merge([body, *rails, *posts, *bars])


def _tarpaulin_load(start: float, end: float, width: float, height: float) -> Mesh:
    """Drop sides below a tarpaulin that sags between its hoops and rounds over at the roof."""
    hoops = max(round((start - end) / 0.9), 4)
    x = np.linspace(end + 0.03, start - 0.03, 2 * hoops + 1)
    sag = np.where(np.arange(len(x)) % 2 == 1, 0.022, 0.0)
    half, base = width / 2 - 0.015, _BED_M + 0.42
    rings = []
    for at, depth in zip(x, sag, strict=True):
        w, top = half - depth, height - depth
        y = np.array([w, w, w - 0.03, w - 0.14, 0.0, -w + 0.14, -w + 0.03, -w, -w])
        z = np.array([base, base + 0.9, top - 0.20, top - 0.07, top, top - 0.07, top - 0.20, base + 0.9, base])
        rings.append(np.stack([np.full(len(y), at), y, z], 1))
    cover = loft(np.stack(rings), "tarpaulin")
    length, middle = start - end, (start + end) / 2
    sides = box((length, width, 0.44), (middle, 0, _BED_M + 0.22), "steel_galvanised")
    return Mesh.merge([cover, sides])


def _chassis(spec: ModelSpec, load_start: float) -> list[Mesh]:
    rear = -spec.length_m / 2 + 0.25
    front = spec.front_axle_x_m + 0.4
    rails = [box((front - rear, 0.10, 0.26), ((front + rear) / 2, y, 0.86), "underbody") for y in (-0.42, 0.42)]
    cross = [box((0.12, 0.90, 0.16), (x, 0, 0.90), "underbody") for x in np.linspace(rear + 0.1, load_start, 5)]
    bearers = [
        box((0.10, spec.width_m - 0.2, 0.12), (x, 0, _BED_M - 0.06), "underbody")
        for x in np.linspace(rear, load_start - 0.2, 6)
    ]
    tank_x = spec.front_axle_x_m - 1.5
    tank = cylinder(0.30, 0.95, "chrome", 14, "x").moved((tank_x - 0.475, 0.80, 0.66))
    battery = box((0.80, 0.50, 0.45), (tank_x, -0.85, 0.66), "car_trim")
    guard_front, guard_rear = tank_x - 0.65, spec.rear_axle_x_m + (1.95 if _tandem(spec) else 0.65)
    guards = [
        box((guard_front - guard_rear, 0.03, 0.10), ((guard_front + guard_rear) / 2, y, z), "steel_galvanised")
        for y in (-spec.width_m / 2 + 0.10, spec.width_m / 2 - 0.10)
        for z in (0.50, 0.80)
    ]
    return [*rails, *cross, *bearers, tank, battery, *guards]


def _tandem(spec: ModelSpec) -> bool:
    return spec.length_m > 10.0


def _wheels(spec: ModelSpec) -> list[Mesh]:
    """Single wheels in front, twin wheels behind; a long truck has a tandem."""
    axles = [(spec.front_axle_x_m, _TYRE_WIDTH_M), (spec.rear_axle_x_m, 0.58)]
    if _tandem(spec):
        axles.append((spec.rear_axle_x_m + 1.32, 0.58))
    parts = []
    for x, width in axles:
        outer = (spec.track_m + _TYRE_WIDTH_M) / 2
        left = wheel(_WHEEL_RADIUS_M, width, spokes=0).moved((x, outer - width / 2, _WHEEL_RADIUS_M))
        ends = np.array([(x, -outer + 0.3, _WHEEL_RADIUS_M), (x, outer - 0.3, _WHEEL_RADIUS_M)])
        axle = tube(ends, 0.08, "underbody", 6)
        parts += [left, mirrored(left), axle]
        if width > _TYRE_WIDTH_M:
            parts += [_mudguard(x, outer - width / 2, width), mirrored(_mudguard(x, outer - width / 2, width))]
    return parts


def _mudguard(x: float, y: float, width: float) -> Mesh:
    turn = np.radians(np.linspace(25, 155, 7))
    arc = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
    axle, wide = np.array([x, y, _WHEEL_RADIUS_M]), np.array([0, width / 2 + 0.02, 0])
    outer, inner = axle + (_WHEEL_RADIUS_M + 0.08) * arc, axle + (_WHEEL_RADIUS_M + 0.07) * arc
    return loft(np.stack([outer - wide, outer + wide, inner + wide, inner - wide], 1), "plastic_dark")


def _rear(spec: ModelSpec) -> list[Mesh]:
    """Underrun bar with lamps and plate."""
    x = -spec.length_m / 2
    bar = box((0.10, spec.width_m - 0.12, 0.14), (x + 0.10, 0, 0.56), "steel_galvanised")
    stays = [box((0.08, 0.06, 0.34), (x + 0.12, y, 0.78), "underbody") for y in (-0.42, 0.42)]
    side_y = spec.width_m / 2 - 0.32
    lamps = [box((0.05, 0.40, 0.12), (x + 0.03, y, 0.72), "tail_lamp") for y in (-side_y, side_y)]
    holders = [box((0.06, 0.40, 0.14), (x + 0.08, y, 0.72), "car_trim") for y in (-side_y, side_y)]
    return [bar, *stays, *lamps, *holders, number_plate(x, 0.76, 0.06)]
