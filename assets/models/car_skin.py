"""Skin of a car: flanks with wheel arches, bonnet, glazed greenhouse, roof and underbody in one sheet."""

from __future__ import annotations

import numpy as np

from assets.materials import material_index
from assets.models.car_lines import CarLines
from assets.models.catalogue import ModelSpec
from assets.models.shell import HalfShell
from assets.models.styles import BodyStyle

FLANK = (0.0, 0.20, 0.42, 0.62, 0.83, 1.0)  # flank rows, share of the way from underbody to belt
ROOF = (0.93, 0.54, 0.0)  # roof rows, share of the way from the centre line to the crest
BELT_STRIP_M, CANTRAIL_M = 0.025, 0.055  # opaque strips below and above the side windows
# rows of cells
SILL, INTAKE, BUMPER, LAMP, SHOULDER = range(3, 8)
STRIP, PANE_LOW, PANE_HIGH, RAIL, ROOF_EDGE = range(8, 13)
_LEAST_RISE_M = 0.05
_LEAST_PANE_M = 0.13  # minimum height of the greenhouse above the belt line for glass


def car_skin(spec: ModelSpec, style: BodyStyle, lines: CarLines) -> HalfShell:
    """Left half of the skin; rows as named above, 3 below the sill for the underbody and the wheel wells."""
    flank = _flank(style, lines)
    greenhouse = _greenhouse(style, lines, flank[:, -1])
    roof = _roof(style, lines, greenhouse[:, -1])
    below = _below(spec, style, lines, flank[:, 0])
    points = np.concatenate([below, flank, greenhouse[:, 1:], roof], axis=1)
    points[[0, -1], :, 1] = 0.0
    return HalfShell(points, _materials(style, lines, points))


def _flank_inset(lines: CarLines, share: np.ndarray) -> np.ndarray:
    """Distance of the flank inside the plan outline; `share` (c, k) of the way from underbody to belt."""
    facing = np.abs(lines.normal[:, :1])
    tuck = 0.045 + 0.02 * facing
    roll = np.where(lines.normal[:, :1] > 0, 0.045 + 0.055 * facing, 0.045 + 0.02 * facing)
    low = np.clip(1 - share / 0.38, 0, 1) ** 2
    high = np.clip((share - 0.45) / 0.55, 0, 1) ** 1.8
    crease = 0.010 * np.exp(-(((share - 0.78) / 0.07) ** 2)) * (1 - facing)
    return tuck * low + roll * high - crease


def _inward(lines: CarLines, inset: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Points (c, k, 3) at `inset` (c, k) from the plan outline."""
    x = lines.x[:, None] - lines.normal[:, :1] * inset
    y = np.maximum(lines.half_width[:, None] - lines.normal[:, 1:] * inset, 0.0)
    return np.stack([x, y, np.broadcast_to(height, x.shape)], -1)


def _flank(style: BodyStyle, lines: CarLines) -> np.ndarray:
    height = lines.bottom[:, None] + (lines.belt - lines.bottom)[:, None] * np.array(FLANK)
    share = (height - style.clearance_m) / (lines.belt - style.clearance_m)[:, None]
    return _inward(lines, _flank_inset(lines, share), height)


def _greenhouse(style: BodyStyle, lines: CarLines, foot: np.ndarray) -> np.ndarray:
    """Rows from the belt to the crest: strip, pane in two halves, cantrail."""
    rise = np.maximum(lines.crest - lines.belt, 0.012)
    low = np.minimum(BELT_STRIP_M / rise, 0.3)
    high = 1 - np.minimum(CANTRAIL_M / rise, 0.35)
    share = np.stack([np.zeros_like(rise), low, (low + high) / 2, high, np.ones_like(rise)], 1)
    share[rise < _LEAST_RISE_M, 1:4] = 1.0  # a bonnet's edge needs no rows of panes
    lean = 0.035 * share**0.5 + style.tumblehome * rise[:, None] * share**1.35
    lean = np.minimum(lean, 0.9 * np.maximum(lines.half_width, 0.02)[:, None] + 0.05)
    x = foot[:, None, 0] - lines.normal[:, :1] * lean
    y = np.maximum(foot[:, None, 1] - lines.normal[:, 1:] * lean, 0.0)
    return np.stack([x, y, foot[:, None, 2] + rise[:, None] * share], -1)


def _roof(style: BodyStyle, lines: CarLines, crest: np.ndarray) -> np.ndarray:
    """Rows from next to the crest to the centre line, curved forward and upward."""
    t = np.array(ROOF)
    width = crest[:, 1]
    grown = (width / max(width.max(), 0.1)) ** 2
    x = crest[:, None, 0] + (lines.bow * np.minimum(grown * 1.2, 1))[:, None] * (1 - t**2)
    z = crest[:, None, 2] + (style.crown_m * grown)[:, None] * (1 - np.abs(t) ** 2.6)
    return np.stack([x, width[:, None] * t, z], -1)


def _below(spec: ModelSpec, style: BodyStyle, lines: CarLines, sill: np.ndarray) -> np.ndarray:
    """Rows from the centre line below to the inner wall of the wheel well and up to its roof."""
    wall = np.minimum(spec.track_m / 2 - 0.15, 0.85 * sill[:, 1])
    floor = np.where(lines.in_arch, style.clearance_m, sill[:, 2])
    x = sill[:, 0]
    return np.stack(
        [
            np.stack([x, np.zeros_like(x), floor], -1),
            np.stack([x, wall, floor], -1),
            np.stack([x, wall, sill[:, 2]], -1),
        ],
        1,
    )


def _materials(style: BodyStyle, lines: CarLines, points: np.ndarray) -> np.ndarray:
    cells = np.full((points.shape[0] - 1, points.shape[1] - 1), material_index("car_paint"), np.uint8)
    share = lines.behind / lines.behind[-1]
    start, end = share[:-1], share[1:]
    middle_y = (points[:-1, SHOULDER, 1] + points[1:, SHOULDER, 1]) / 2 / lines.half_width.max()
    front, rear = end < 0.5, start > 0.5

    def put(rows: int | slice, columns: np.ndarray, name: str) -> None:
        cells[columns, rows] = material_index(name)

    every = np.ones(len(cells), bool)
    put(slice(0, SILL), every, "underbody")
    put(SILL, every if style.cladding else (front | rear) & (lines.normal[:-1, 1] < 0.8), "car_trim")
    if style.cladding:
        put(INTAKE, lines.in_arch[:-1] & lines.in_arch[1:], "car_trim")
    put(INTAKE, front & (middle_y < 0.6), "car_trim")
    put(LAMP, front & (middle_y < 0.5), "car_trim")
    put(LAMP, front & (middle_y > 0.5) & (start * lines.behind[-1] < 0.30), "headlamp")
    put(LAMP, rear & (middle_y > 0.62) & ((1 - end) * lines.behind[-1] < 0.2), "tail_lamp")

    rise = lines.crest - lines.belt
    tall = (rise[:-1] > _LEAST_PANE_M) & (rise[1:] > _LEAST_PANE_M)
    for pane in style.panes:
        put(slice(PANE_LOW, RAIL), tall & _within(start, end, pane), "car_glass")
    put(slice(ROOF_EDGE + 1, None), _within(start, end, style.windscreen), "car_glass")
    put(slice(ROOF_EDGE + 1, None), _within(start, end, style.backlight), "car_glass")
    return cells


def _within(start: np.ndarray, end: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    slack = 0.004
    return (start > span[0] - slack) & (end < span[1] + slack)
