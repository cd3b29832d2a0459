"""Low-floor city buses."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.models.box_body import BoxBody, Window, box_skin, hanging_mirrors
from assets.models.catalogue import ModelSpec
from assets.models.fittings import number_plate
from assets.models.seats import plain_seat, seat, steering_wheel
from assets.models.wheels import four_wheels
from assets.shapes import box

_WHEEL_RADIUS_M = 0.48
_FLOOR_M = 0.40
_PILLAR_M = 0.10
_NOSE_GAP_M = 0.10  # the mirrors reach this far ahead of the windscreen
# height, inset of the flanks, inset of the ends
_LEVELS = (
    (0.30, 0.03, 0.06),
    (0.62, 0.0, 0.0),
    (0.86, 0.0, 0.01),
    (1.16, 0.0, 0.03),
    (2.28, 0.02, 0.10),
    (2.62, 0.03, 0.14),
    (2.88, 0.10, 0.24),
    (3.01, 0.28, 0.45),
)
_BAND = (3, 4)


def build_bus(spec: ModelSpec) -> Mesh:
    """Mesh of a bus with three doors on the right (variant 0) or two (variant 1)."""
    length = spec.length_m - _NOSE_GAP_M - 0.008
    body = BoxBody(
        front_x=spec.length_m / 2 - _NOSE_GAP_M,
        length=length,
        half_width=spec.width_m / 2,
        levels=_LEVELS,
        roof_m=spec.height_m,
        axles=[spec.length_m / 2 - _NOSE_GAP_M - x for x in (spec.front_axle_x_m, spec.rear_axle_x_m)],
        arch=(_WHEEL_RADIUS_M + 0.07, 2 * _WHEEL_RADIUS_M + 0.06),
        nose=(0.34, 3.2),
        tail=(0.22, 3.6),
        windows=_windows(length, spec.variant),
        well_y=spec.track_m / 2 - 0.24,
        spread=7,
    )
    skin = box_skin(body)
    front = body.front_x
    return Mesh.merge(
        [
            skin.whole(),
            skin.lining(0.30, length - 0.25, 0.05),
            *_saloon(spec, front, length),
            four_wheels(spec, _WHEEL_RADIUS_M, 0.30, spokes=0),
            hanging_mirrors((spec.length_m / 2, spec.width_m / 2, 2.55)),
            box((length * 0.45, 1.7, 0.01), (-0.5, 0, spec.height_m - 0.005), "car_trim"),
            number_plate(front + 0.006, 0.50, 0.10),
            number_plate(-spec.length_m / 2, 0.66, 0.06),
        ]
    )


def _windows(length: float, variant: int) -> tuple[Window, ...]:
    count = 7 - variant
    start, end = 0.62, length - 0.75
    pitch = (end - start) / count
    side = [Window((start + k * pitch, start + (k + 1) * pitch - _PILLAR_M), _BAND) for k in range(count)]
    doors = (0, 3, 5) if variant == 0 else (0, 3)
    doorways = [Window(side[k].span, (1, 4), "right") for k in doors]
    return (
        Window((0.0, 0.30), (2, 4)),
        Window((0.0, 0.30), (4, 5), material="car_trim"),
        Window((0.0, length), (0, 1), material="car_trim"),
        Window((0.06, 0.17), (1, 2), material="headlamp"),
        Window((length - 0.10, length - 0.04), (1, 3), material="tail_lamp"),
        Window((length - 0.035, length), _BAND),
        *side,
        *doorways,
    )


def _saloon(spec: ModelSpec, front: float, length: float) -> list[Mesh]:
    """Floor, wheel boxes, driver's place and rows of seats."""
    axles = (spec.front_axle_x_m, spec.rear_axle_x_m)
    parts = [box((length - 0.6, spec.track_m - 0.52, 0.04), (front - length / 2, 0, _FLOOR_M - 0.02), "car_interior")]
    ends = [front - 0.30, *(x + way * 0.6 for x in axles for way in (1, -1)), front - length + 0.30]
    for start, end in zip(ends[::2], ends[1::2], strict=True):  # next to the aisle, between the wheels
        for side in (-1, 1):
            y = side * (spec.width_m / 2 + spec.track_m / 2 - 0.32) / 2
            size = (start - end, (spec.width_m - spec.track_m) / 2 + 0.20, 0.04)
            parts.append(box(size, ((start + end) / 2, y, _FLOOR_M - 0.02), "car_interior"))
    for x in axles:
        for side in (-1, 1):
            wall, flank = spec.track_m / 2 - 0.26, spec.width_m / 2 - 0.06
            parts.append(box((1.2, 0.02, 0.68), (x, side * wall, _FLOOR_M + 0.34), "car_interior"))
            top = (x, side * (wall + flank) / 2, 2 * _WHEEL_RADIUS_M + 0.10)
            parts.append(box((1.2, flank - wall, 0.03), top, "car_interior"))
    position = (front - 1.10, 0.25 * spec.width_m)
    parts.append(seat(_FLOOR_M + 0.62).moved((*position, 0)))
    parts.append(box((0.5, 0.5, 0.48), (position[0], position[1], _FLOOR_M + 0.24), "car_interior"))
    parts.append(steering_wheel(0.23, 30.0).moved((position[0] + 0.42, position[1], _FLOOR_M + 0.92)))
    parts.append(box((0.32, 1.5, 0.62), (front - 0.42, 0.45, _FLOOR_M + 0.31), "car_interior"))
    double = plain_seat(0.86, 0.46)
    for x in np.arange(front - 2.5, front - length + 0.9, -0.80):
        podium = 0.68 if min(abs(x - axle) for axle in axles) < 0.9 else 0.02
        for side in (-1, 1):
            parts.append(double.moved((x, side * (spec.width_m / 2 - 0.56), _FLOOR_M + podium)))
    return parts
