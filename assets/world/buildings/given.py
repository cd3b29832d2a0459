"""Buildings and trees defined by a scenario, instead of random ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely

from assets.materials import material_index
from assets.mesh import Mesh
from assets.shapes import plate
from assets.streets import StreetBuilding
from assets.world.buildings.facades import BLANK, WINDOW, Cells, facade_mesh
from assets.world.styles import TownStyle

_FOUNDATION_M, _FLOOR_M = 0.6, 0.15
_STOREY_M = 3.0
_SLAB_M = 0.02  # ceilings lie this far under the roof
_SHORTEST_M = 0.05  # of a wall
_ROOM_M = 0.6  # from the façade to the dark wall behind its panes
_WINDOW_M = (1.1, 1.4, 0.9)  # width, height and height of the sill
_BLIND_SHARE = 0.15


def given_buildings(
    buildings: Sequence[StreetBuilding],
    terrain_z: Callable[[np.ndarray], np.ndarray],
    style: TownStyle,
    rng: np.random.Generator,
) -> Mesh:
    """Buildings with these outlines and heights; walls have windows, roofs are flat.

    Args:
        buildings: the buildings.
        terrain_z: maps (n, 2) to world heights (n,).
        style: walls to choose from.
        rng: generator for walls, windows and unknown heights.
    """
    return Mesh.merge([_building(one, terrain_z, style, rng) for one in buildings])


def outline_polygon(building: StreetBuilding) -> shapely.Polygon:
    """A building's outline, counter-clockwise; empty where it encloses nothing."""
    polygon = shapely.make_valid(shapely.Polygon(building.outline))
    parts = [part for part in shapely.get_parts(polygon) if part.geom_type == "Polygon" and part.area > 1.0]
    if not parts:
        return shapely.Polygon()
    largest = max(parts, key=lambda part: part.area)
    return shapely.geometry.polygon.orient(shapely.Polygon(shapely.simplify(largest, _SHORTEST_M).exterior))


def _building(
    building: StreetBuilding, terrain_z: Callable[[np.ndarray], np.ndarray], style: TownStyle, rng: np.random.Generator
) -> Mesh:
    polygon = outline_polygon(building)
    storeys = int(rng.integers(style.storeys[0], style.storeys[1] + 1))
    wall = str(rng.choice(style.walls))
    if polygon.is_empty:
        return Mesh.empty()
    height_m = building.height_m or storeys * _STOREY_M
    corners = shapely.get_coordinates(polygon.exterior)[:-1]
    ground = terrain_z(corners)
    foot, floor = float(ground.min()) - _FOUNDATION_M, float(ground.mean()) + _FLOOR_M
    room = shapely.buffer(polygon, -_ROOM_M, join_style="mitre")
    inside = None if room.is_empty or room.geom_type != "Polygon" else shapely.get_coordinates(room.exterior)[:-1]
    ends = np.roll(corners, -1, axis=0)
    walls = [
        cells
        for start, end in zip(corners, ends, strict=True)
        if np.linalg.norm(end - start) > _SHORTEST_M
        for cells in _wall(start, end, (foot, floor, height_m), wall, rng, windows=inside is not None)
    ]
    parts = [facade_mesh(Cells.merge(walls)), plate(corners, "roof_flat", floor + height_m)]
    if inside is not None:
        count = max(1, round(height_m / _STOREY_M))
        levels = floor + np.arange(count + 1) * height_m / count
        parts += [
            _band(inside, levels[0], levels[-1]),
            *(plate(corners, "room_interior", level - _SLAB_M) for level in levels),
        ]
    return Mesh.merge(parts)


def _wall(
    start: np.ndarray,
    end: np.ndarray,
    heights_m: tuple[float, float, float],
    wall: str,
    rng: np.random.Generator,
    *,
    windows: bool,
) -> list[Cells]:
    """Cells of a wall from the ground floor up, and its plinth."""
    foot, floor, height = heights_m
    length = float(np.linalg.norm(end - start))
    right = (end - start) / length
    width, tall, sill = _WINDOW_M
    columns, storeys = max(1, int(length / 3.0)), max(1, round(height / _STOREY_M))
    wide, high = length / columns, height / storeys
    column, storey = (grid.reshape(-1) for grid in np.meshgrid(np.arange(columns), np.arange(storeys)))
    n = len(column)
    corner = np.column_stack([start + right * (column * wide)[:, None], floor + storey * high])
    opening = np.tile([(wide - width) / 2, sill, (wide + width) / 2, sill + tall], (n, 1))
    kind = np.where(rng.random(n) < _BLIND_SHARE, BLANK, WINDOW)
    if not windows or wide < width + 0.4 or high < sill + tall + 0.2:
        kind[:] = BLANK
    door = np.full(n, material_index("door"))
    upper = Cells(
        corner, np.tile(right, (n, 1)), np.tile([wide, high], (n, 1)), opening, kind,
        np.full(n, material_index(wall)), door,
    )  # fmt: skip
    lower = Cells(
        np.array([[*start, foot]]), right[None], np.array([[length, floor - foot]]), np.zeros((1, 4)),
        np.full(1, BLANK), np.full(1, material_index("concrete")), door[:1],
    )  # fmt: skip
    return [upper, lower]


def _band(corners: np.ndarray, low: float, high: float) -> Mesh:
    """The dark walls of rooms, seen from outside."""
    n = len(corners)
    points = np.concatenate([np.column_stack([corners, np.full(n, z)]) for z in (low, high)])
    k = np.arange(n)
    m = (k + 1) % n
    return Mesh.of(
        points, np.concatenate([np.stack([k, m, m + n], 1), np.stack([k, m + n, k + n], 1)]), "room_interior"
    )
