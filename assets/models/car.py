"""Cars and vans: skin, wheels, cabin and fittings put together."""

from __future__ import annotations

import numpy as np

from assets.materials import material_column
from assets.mesh import Mesh
from assets.models.cabin import cabin
from assets.models.car_lines import CarLines, car_lines
from assets.models.car_skin import RAIL, ROOF_EDGE, STRIP, car_skin
from assets.models.catalogue import ModelSpec
from assets.models.fittings import number_plate, side_mirrors
from assets.models.shell import HalfShell
from assets.models.styles import STYLES, BodyStyle
from assets.models.wheels import four_wheels

_LINING_DEPTH_M = 0.03
_PLATE_DEPTH_M = 0.04


def build_car(spec: ModelSpec) -> Mesh:
    """Mesh of a car or van, its box within millimetres of `spec`."""
    style = STYLES[spec.body][spec.variant]
    lines = car_lines(spec, style)
    skin = car_skin(spec, style, lines)
    return Mesh.merge(
        [
            skin.whole(),
            skin.lining(_lined(style, lines, skin), _LINING_DEPTH_M, "car_interior"),
            cabin(spec, style, lines, skin, STRIP),
            four_wheels(spec, style.wheel_radius_m(spec), 0.19),
            _mirrors(spec, style, lines, skin),
            *_plates(spec, style, lines),
        ]
    )


def _lined(style: BodyStyle, lines: CarLines, skin: HalfShell) -> np.ndarray:
    """Cells of the greenhouse that show an inner side: its pillars and roof."""
    opaque = (material_column("kind") != "glass")[skin.materials]
    share = lines.behind / lines.behind[-1]
    start, end = share[:-1], share[1:]
    cabin_end = min(style.backlight[1], style.bulkhead)
    inside = (start > style.windscreen[0] - 0.004) & (end < cabin_end + 0.004)
    lined = opaque & inside[:, None]
    lined[:, :STRIP] = False
    lined[end < style.windscreen[1], RAIL : ROOF_EDGE + 1] = False  # the A-pillar is thinner than a lining
    return lined


def _mirrors(spec: ModelSpec, style: BodyStyle, lines: CarLines, skin: HalfShell) -> Mesh:
    column = int(np.searchsorted(lines.behind / lines.behind[-1], style.panes[0][0] - 0.01))
    x, y, z = skin.points[column, STRIP]
    size = 1.0 if spec.kind == "car" else 1.5
    return side_mirrors((x + 0.10 * size, y - 0.03, z), spec.width_m / 2, size)


def _plates(spec: ModelSpec, style: BodyStyle, lines: CarLines) -> list[Mesh]:
    """Plates on the foremost and rearmost part of the bumpers."""
    height = [style.clearance_m + 0.46 * (lines.belt[end] - style.clearance_m) for end in (0, -1)]
    return [
        number_plate(spec.length_m / 2, height[0], _PLATE_DEPTH_M),
        number_plate(-spec.length_m / 2, height[1], _PLATE_DEPTH_M),
    ]
