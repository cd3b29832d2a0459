"""Interior of a car, which beams hit behind the glass."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.models.car_lines import CarLines
from assets.models.catalogue import ModelSpec
from assets.models.seats import bench, seat, steering_wheel
from assets.models.shell import HalfShell, both_sides
from assets.models.styles import BodyStyle
from assets.shapes import extrude, flipped, quad_strip

_FLOOR_OVER_UNDERBODY_M = 0.09
_DOOR_DEPTH_M = 0.08


def cabin(spec: ModelSpec, style: BodyStyle, lines: CarLines, skin: HalfShell, belt_row: int) -> Mesh:
    """Tub with door panels, dashboard, seats and parcel shelf.

    Args:
        spec: dimensions.
        style: lines of the body.
        lines: the lines sampled at the sections of `skin`.
        skin: outer skin.
        belt_row: row of `skin` that lies on the belt.
    """
    length = lines.behind[-1]
    floor = style.clearance_m + _FLOOR_OVER_UNDERBODY_M
    cowl = style.windscreen[0] * length
    tail = min(style.backlight[1] * length, length - 0.10)
    if style.bulkhead < 1:
        tail = style.bulkhead * length
    inside = (lines.behind > cowl - 0.02) & (lines.behind < tail + 0.01)
    belt = skin.points[inside, belt_row]
    door = _doors(spec, lines, inside, belt, floor)
    parts = [_tub(door, belt), _end_wall(door[-1]), flipped(_end_wall(door[0]))]
    width = 2 * float(np.median(door[:, -1, 1])) - 0.01
    front_seat = length / 2 - spec.front_axle_x_m + 0.50 * min(spec.wheelbase_m, 2.7)
    sit = floor + 0.20 + 0.25 * max(spec.height_m - 1.5, 0)
    scale = float(np.clip(spec.height_m / 1.5, 0.95, 1.12))
    lateral = 0.225 * spec.width_m
    for y in (-lateral, lateral):
        parts.append(seat(sit, scale).moved((length / 2 - front_seat, y, 0)))
    parts += [_dashboard(lines, skin, belt_row, cowl, width), _cowl(lines, skin, belt_row, cowl)]
    wheel_x = length / 2 - front_seat + 0.42
    parts.append(steering_wheel().moved((wheel_x, lateral, sit + 0.36)))
    if style.bulkhead < 1:
        return Mesh.merge([*parts, _bulkhead(skin, int(np.flatnonzero(inside)[-1]), belt_row)])
    return Mesh.merge([*parts, *_rear_rows(spec, lines, door, belt, sit, 0.94 * width)])


def _rear_rows(
    spec: ModelSpec, lines: CarLines, door: np.ndarray, belt: np.ndarray, sit: float, width: float
) -> list[Mesh]:
    """Benches, as high as the roof above them allows, and in a car the cover of the boot."""
    length = lines.behind[-1]
    axle = length / 2 - spec.rear_axle_x_m
    hips = [axle - 0.48] if spec.kind == "car" else [axle - 1.25, axle - 0.45]
    parts = []
    for hip in hips:
        room = float(np.interp(hip + 0.42, lines.behind, lines.crest)) - 0.06 - sit
        parts.append(bench(sit, width, float(np.clip(room / 0.80, 0.6, 1.1))).moved((length / 2 - hip, 0, 0)))
    if spec.kind == "car":
        parts.append(_parcel_shelf(door, belt, length / 2 - hips[-1] - 0.34))
    return parts


def _doors(spec: ModelSpec, lines: CarLines, inside: np.ndarray, belt: np.ndarray, floor: float) -> np.ndarray:
    """Points (c, 5, 3) of the tub's section: floor centre, foot of the door panel or wheel box, its top edge,
    the panel above it, the panel's top."""
    near_arch = lines.in_arch.copy()
    near_arch[:-1] |= lines.in_arch[1:]
    near_arch[1:] |= lines.in_arch[:-1]
    top = np.maximum(belt[:, 1] - _DOOR_DEPTH_M, 0.02)
    foot = np.where(near_arch[inside], np.minimum(spec.track_m / 2 - 0.17, top), top - 0.02)
    x, high = belt[:, 0], belt[:, 2] - 0.04
    low = np.full_like(x, floor)
    crown = np.minimum(lines.bottom.max() + 0.03, high - 0.02)
    rows = [(np.zeros_like(x), low), (foot, low), (foot, crown), (top, crown), (top, high)]
    return np.stack([np.stack([x, y, z], -1) for y, z in rows], 1)


def _tub(door: np.ndarray, belt: np.ndarray) -> Mesh:
    """Floor and door panels, closed against the skin just below the belt; faces look inward."""
    ledge = belt[:, None] - (0.0, 0.006, 0.012)
    return both_sides(flipped(quad_strip(np.concatenate([door, ledge], 1), "car_interior")))


def _end_wall(edge: np.ndarray) -> Mesh:
    """Wall across the tub within its section `edge` (5, 3), looking forward."""
    return both_sides(quad_strip(np.stack([edge[1:] * (1, 0, 1), edge[1:]]), "car_interior"))


def _dashboard(lines: CarLines, skin: HalfShell, belt_row: int, cowl: float, width: float) -> Mesh:
    """Dashboard under the windscreen, from the cowl back to the instruments."""
    column = int(np.searchsorted(lines.behind, cowl - 0.01))
    x = float(skin.points[column, belt_row, 0])
    top = float(skin.points[column, belt_row, 2]) - 0.01
    low = max(float(lines.bottom.max()) + 0.03, top - 0.32)
    section = np.array(  # z, x
        [
            (low, x - 0.02),
            (top - 0.02, x + 0.03),
            (top, x - 0.20),
            (top - 0.03, x - 0.42),
            (top - 0.15, x - 0.44),
            (low, x - 0.30),
        ]
    )
    return extrude(section, width, "car_interior", axis="y").moved((0, -width / 2, 0))


def _cowl(lines: CarLines, skin: HalfShell, belt_row: int, cowl: float) -> Mesh:
    """Ledge that fills the bow of the windscreen ahead of the dashboard."""
    column = int(np.searchsorted(lines.behind, cowl - 0.01))
    foot = skin.points[column, belt_row + 4 :] - (0.0, 0.0, 0.025)
    back = np.stack([np.full(len(foot), skin.points[column, belt_row, 0] - 0.03), foot[:, 1], foot[:, 2]], 1)
    return both_sides(quad_strip(np.stack([foot, back]), "car_interior"))


def _parcel_shelf(door: np.ndarray, belt: np.ndarray, start_x: float) -> Mesh:
    """Cover of the boot, from behind the rear seats to the tailgate."""
    behind = belt[:, 0] < start_x
    edge = door[behind, -1] - (0.0, 0.0, 0.03)
    return both_sides(quad_strip(np.stack([edge, edge * (1, 0, 1)], 1), "car_interior"))


def _bulkhead(skin: HalfShell, column: int, belt_row: int) -> Mesh:
    """Wall between the cab of a panel van and its load, from the belt to the roof, looking forward."""
    outline = skin.points[column, belt_row:] - (0.0, 0.012, 0.012)
    outline[:, 1] = np.maximum(outline[:, 1], 0.0)
    return both_sides(quad_strip(np.stack([outline * (1, 0, 1), outline]), "car_interior"))
