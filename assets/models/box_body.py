"""Box-shaped bodies with rounded corners and bands of windows: buses and the cabs of trucks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.materials import material_column, material_index
from assets.mesh import Mesh
from assets.models.plan import Rounding, arch_rise, plan_outline, sections
from assets.models.shell import HalfShell
from assets.shapes import Vector, box, mirrored, weld

_ROOF = (0.55, 0.0)
_LEAN_M = 0.95  # the ends' lean fades out over this length
_SLACK_M = 0.013  # distance of sections from the requested edges
_BELOW = 3  # rows under the sill: centre line, wall and roof of the wheel wells


@dataclass(frozen=True)
class Window:
    """A band of glass in the skin.

    Attributes:
        span: start and end, metres behind the nose.
        levels: first and last level of the body it lies between.
        side: `both`, `left` or `right`.
        material: of its cells.
    """

    span: tuple[float, float]
    levels: tuple[int, int]
    side: str = "both"
    material: str = "car_glass"


@dataclass(frozen=True)
class BoxBody:
    """Shape of a box body.

    Attributes:
        front_x: position of the nose in the model's frame, metres.
        length: metres.
        half_width: metres.
        levels: (k, 3) height, inset of the flanks and inset of both ends, metres, from sill to roof edge.
        roof_m: height of the roof's centre line.
        axles: distance behind the nose of each axle with a wheel arch.
        arch: radius of the arches and height of their crown above ground.
        nose: rounding of the front in plan.
        tail: rounding of the rear in plan.
        windows: later ones win.
        well_y: half-distance of the inner walls of the wheel wells.
    """

    front_x: float
    length: float
    half_width: float
    levels: tuple[tuple[float, float, float], ...]
    roof_m: float
    axles: list[float]
    arch: tuple[float, float]
    nose: Rounding
    tail: Rounding
    windows: tuple[Window, ...]
    well_y: float
    spread: int = 8


@dataclass(frozen=True)
class BoxSkin:
    """Both halves of a built box body; they share points and differ in materials."""

    behind: np.ndarray
    left: HalfShell
    right: HalfShell

    def whole(self) -> Mesh:
        """The outer skin."""
        return weld(Mesh.merge([self.left.half(), mirrored(self.right.half())]))

    def lining(self, start: float, end: float, depth_m: float) -> Mesh:
        """Inner skin between two distances behind the nose: walls, pillars and ceiling."""
        inside = (self.behind[:-1] > start) & (self.behind[1:] < end)
        glass = material_column("kind") == "glass"
        halves = []
        for half in (self.left, self.right):
            cells = inside[:, None] & ~glass[half.materials]
            cells[:, :_BELOW] = False
            halves.append(half.half_lining(cells, depth_m, "car_interior"))
        return weld(Mesh.merge([halves[0], mirrored(halves[1])]))


def box_skin(body: BoxBody) -> BoxSkin:
    """Skin of a box body."""
    edges = np.array([edge for window in body.windows for edge in window.span])
    edges = edges[(edges > 0) & (edges < body.length)]
    radius, crown = body.arch
    behind = sections(body.length, body.nose, body.tail, body.axles, radius, edges, body.spread, (0, 0.45, 0.8, 0.96))
    half_width, _ = plan_outline(behind, body.length, body.half_width, body.nose, body.tail)
    height, side, end = np.array(body.levels).T
    rise = np.max([arch_rise(behind, axle, radius, crown - height[0]) for axle in body.axles], axis=0)
    fixed = height > crown  # levels above the arches stay put, those below are squeezed
    anchor = height[fixed][0]
    squeeze = (anchor - height[0] - rise) / (anchor - height[0])
    heights = np.where(fixed, height, anchor - (anchor - height) * squeeze[:, None])
    keep = np.where(fixed, 1.0, (squeeze[:, None] > 0.999))
    lean = np.clip(1 - behind / _LEAN_M, 0, 1) - np.clip(1 - (body.length - behind) / _LEAN_M, 0, 1)
    x = (body.front_x - behind)[:, None] - end * lean[:, None]
    y = half_width[:, None] * (1 - keep * side / body.half_width)
    flank = np.stack([x, y, heights], -1)
    points = np.concatenate([_below(body, flank[:, 0], rise > 0), flank, _roof(body, flank[:, -1])], axis=1)
    points[[0, -1], :, 1] = 0.0
    left, right = (HalfShell(points, _materials(body, behind, len(body.levels), way)) for way in ("left", "right"))
    return BoxSkin(behind, left, right)


def _below(body: BoxBody, sill: np.ndarray, in_arch: np.ndarray) -> np.ndarray:
    wall = np.minimum(body.well_y, 0.85 * sill[:, 1])
    floor = np.where(in_arch, body.levels[0][0], sill[:, 2])
    x = sill[:, 0]
    rows = [(np.zeros_like(x), floor), (wall, floor), (wall, sill[:, 2])]
    return np.stack([np.stack([x, y, z], -1) for y, z in rows], 1)


def _roof(body: BoxBody, edge: np.ndarray) -> np.ndarray:
    t = np.array(_ROOF)
    rise = (body.roof_m - edge[:, 2]) * np.minimum(edge[:, 1] / edge[:, 1].max(), 1.0)
    z = edge[:, None, 2] + rise[:, None] * (1 - t**2)
    return np.stack([np.broadcast_to(edge[:, None, 0], z.shape), edge[:, 1:2] * t, z], -1)


def _materials(body: BoxBody, behind: np.ndarray, levels: int, side: str) -> np.ndarray:
    cells = np.full((len(behind) - 1, _BELOW + levels + len(_ROOF) - 1), material_index("car_paint"), np.uint8)
    cells[:, :_BELOW] = material_index("underbody")
    for window in body.windows:
        if window.side in ("both", side):
            columns = (behind[:-1] > window.span[0] - _SLACK_M) & (behind[1:] < window.span[1] + _SLACK_M)
            rows = slice(_BELOW + window.levels[0], _BELOW + window.levels[1])
            cells[columns, rows] = material_index(window.material)
    return cells


def hanging_mirrors(root: Vector, drop_m: float = 0.42, arm_m: float = 0.25) -> Mesh:
    """A pair of tall mirrors whose housings' outer upper front corner is `root` (3,) on the left."""
    x, y, z = root
    left = Mesh.merge(
        [
            box((arm_m, 0.04, 0.04), (x - 0.02 - arm_m / 2, y - 0.16, z - 0.02), "car_trim"),
            box((0.09, 0.20, drop_m), (x - 0.045, y - 0.10, z - drop_m / 2), "car_trim"),
            box((0.008, 0.17, drop_m - 0.04), (x - 0.094, y - 0.10, z - drop_m / 2), "mirror"),
        ]
    )
    return Mesh.merge([left, mirrored(left)])
