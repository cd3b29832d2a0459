"""Solo trams: rigid cars on two bogies, which skirts hide."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.models.box_body import BoxBody, Window, box_skin, hanging_mirrors
from assets.models.catalogue import ModelSpec
from assets.models.seats import plain_seat, seat
from assets.shapes import box, cylinder, tube

_WHEEL_RADIUS_M, _TREAD_M = 0.34, 0.13
_SILL_M = 0.16
_FLOOR_M = 0.62
_ROOF_M = 3.02  # the pantograph and its insulators are mounted on it
_PILLAR_M = 0.12
_CAB_M = 1.7
_MIRRORS_M = 0.09  # they reach this far beyond the flanks
# height, inset of the flanks, inset of the ends
_LEVELS = (
    (_SILL_M, 0.05, 0.10),
    (0.48, 0.0, 0.0),
    (0.84, 0.0, 0.02),
    (1.24, 0.0, 0.06),
    (2.20, 0.02, 0.26),
    (2.52, 0.04, 0.34),
    (2.80, 0.12, 0.44),
    (2.94, 0.30, 0.62),
)
_BAND = (3, 4)


def build_tram(spec: ModelSpec) -> Mesh:
    """Mesh of a tram with three doors on the right (variant 0) or two (variant 1), its pantograph folded."""
    front, length = spec.length_m / 2, spec.length_m
    body = BoxBody(
        front_x=front,
        length=length,
        half_width=spec.width_m / 2 - _MIRRORS_M,
        levels=_LEVELS,
        roof_m=_ROOF_M,
        axles=[front - x for x in (spec.front_axle_x_m, spec.rear_axle_x_m)],
        arch=(0.5, _SILL_M),  # flat: the skirts cover the bogies
        nose=(0.85, 2.4),
        tail=(0.85, 2.4),
        windows=_windows(length, spec.variant),
        well_y=spec.track_m / 2 - 0.24,
        spread=6,
    )
    skin = box_skin(body)
    return Mesh.merge(
        [
            skin.whole(),
            skin.lining(0.40, length - 0.40, 0.05),
            *_saloon(spec, front, length),
            *_wheels(spec),
            hanging_mirrors((front - 0.25, spec.width_m / 2, 2.30)),
            *_roof(spec, front),
        ]
    )


def _windows(length: float, variant: int) -> tuple[Window, ...]:
    count = round((length - 3.0) / 1.5)
    start, end = 1.25, length - 1.25
    pitch = (end - start) / count
    side = [Window((start + k * pitch, start + (k + 1) * pitch - _PILLAR_M), _BAND) for k in range(count)]
    doors = (0, count // 2, count - 2) if variant == 0 else (1, count - 2)
    doorways = [Window(side[k].span, (1, 4), "right") for k in doors]
    return (
        Window((0.0, 0.62), (2, 4)),
        Window((0.0, 0.62), (4, 5), material="car_trim"),  # destination board
        Window((length - 0.62, length), _BAND),
        Window((length - 0.62, length), (4, 5), material="car_trim"),
        Window((0.0, length), (0, 1), material="car_trim"),
        Window((0.06, 0.24), (1, 2), material="headlamp"),
        Window((length - 0.24, length - 0.06), (1, 2), material="tail_lamp"),
        *side,
        *doorways,
    )


def _saloon(spec: ModelSpec, front: float, length: float) -> list[Mesh]:
    """Floor, driver's place behind its partition, and rows of seats along the aisle."""
    inner = spec.width_m - 2 * _MIRRORS_M - 0.14
    desk = (0.35, inner * 0.7, 0.5)
    parts = [
        box((length - 1.2, inner, 0.04), (0, 0, _FLOOR_M - 0.02), "car_interior"),
        seat(0.60).moved((front - 1.15, 0, _FLOOR_M)),
        box((0.45, 0.45, 0.46), (front - 1.12, 0, _FLOOR_M + 0.23), "car_interior"),
        box(desk, (front - 0.72, 0, _FLOOR_M + desk[2] / 2), "car_interior"),
        box((0.04, inner * 0.6, 1.5), (front - _CAB_M, 0.2 * inner, _FLOOR_M + 0.75), "car_interior"),
    ]
    double = plain_seat(0.84, 0.45)
    aside = inner / 2 - 0.44
    for x in np.arange(front - _CAB_M - 0.55, 1.2 - front, -0.90):
        parts += [double.moved((x, side * aside, _FLOOR_M)) for side in (-1, 1)]
    return parts


def _wheels(spec: ModelSpec) -> list[Mesh]:
    """A wheelset in the middle of each bogie, standing on z = 0; the skirts show little of it."""
    tread = cylinder(_WHEEL_RADIUS_M, _TREAD_M, "tyre", 12, "y")
    return [
        tread.moved((x, side * spec.track_m / 2 - _TREAD_M / 2, _WHEEL_RADIUS_M))
        for x in (spec.front_axle_x_m, spec.rear_axle_x_m)
        for side in (-1, 1)
    ]


def _roof(spec: ModelSpec, front: float) -> list[Mesh]:
    """Equipment boxes, and the pantograph folded above the front bogie (variant 0) or the middle (variant 1)."""
    x = spec.front_axle_x_m if spec.variant == 0 else 0.0
    foot, top = _ROOF_M + 0.10, spec.height_m
    parts = [
        box((2.4, 1.5, 0.28), (x - 3.2, 0, _ROOF_M + 0.10), "car_trim"),
        box((1.6, 1.4, 0.22), (1.6 - front, 0, _ROOF_M + 0.06), "car_trim"),
        box((1.3, 1.1, 0.05), (x, 0, foot), "steel_painted"),
        box((0.24, 1.5, 0.03), (x + 0.35, 0, top - 0.015), "steel_galvanised"),
    ]
    for y in (-0.45, 0.45):
        knee = np.array([x - 0.75, 0.8 * y, foot + 0.14])
        parts.append(tube(np.array([[x + 0.45, y, foot + 0.02], knee]), 0.025, "steel_painted", 4))
        parts.append(tube(np.array([knee, [x + 0.35, 0.6 * y, top - 0.03]]), 0.02, "steel_galvanised", 4))
        parts.append(box((0.10, 0.10, 0.12), (x - 0.5, y, _ROOF_M + 0.03), "plastic_dark"))
        parts.append(box((0.10, 0.10, 0.12), (x + 0.5, y, _ROOF_M + 0.03), "plastic_dark"))
    return parts
