"""Builds designed houses: walls with windows, rooms behind the panes, roofs, and paths to the doors.

Roofs are unit shapes, stretched to each house by an affine matrix.
"""

from __future__ import annotations

import numpy as np

from assets.materials import material_index
from assets.mesh import Mesh
from assets.shapes import box, clean
from assets.world.buildings.facades import BLANK, DOOR, WINDOW, Cells, facade_mesh
from assets.world.buildings.houses import House
from assets.world.ground.overlays import Heights, ribbons
from assets.world.instancing import instances, poses

_ROOM_DEPTH_M = 0.6  # from the façade to the dark wall behind its panes
_DOOR_M = (1.0, 2.1)
_OVERHANG = {False: (0.03, 0.06), True: (0.0, 0.025)}  # of roofs, at verge and eaves, share of half the house
_BLIND_SHARE = (0.04, 0.5, 0.55, 0.5)  # bays without a window: front, right, back, left
_BLIND_YARDS = 0.9  # the same at the back of terraces, which streets do not see
_LEAST_SETBACK_M = 1.2  # doors nearer to the pavement open onto it
_PATH_RISE_M = 0.03
_DOORSTEP_M = (1.5, 0.8)
_ROOF_THICKNESS = 0.06  # of the unit height


def buildings_mesh(houses: list[House], rng: np.random.Generator) -> Mesh:
    """All houses as one mesh."""
    if not houses:
        return Mesh.empty()
    cells = Cells.merge([part for house in houses for part in _walls(house, rng)])
    rooms = Mesh.merge([_rooms(house) for house in houses])
    return Mesh.merge([facade_mesh(cells), rooms, _roofs(houses), _chimneys(houses, rng)])


def _walls(house: House, rng: np.random.Generator) -> list[Cells]:
    """Cells of the four walls, street front first."""
    corners = house.plot.corners()
    parts = []
    for side in range(4):
        start, end = corners[side], corners[(side + 1) % 4]
        parts += _wall(house, start, end, side, rng)
    return parts


def _wall(house: House, start: np.ndarray, end: np.ndarray, side: int, rng: np.random.Generator) -> list[Cells]:
    length = float(np.linalg.norm(end - start))
    right = (end - start) / length
    party = house.terrace and side in (1, 3)  # a plain wall that the neighbour covers
    columns, storeys = (1, 1) if party else (house.bays(length), house.storeys)
    wide, tall = length / columns, house.storey_m * house.storeys / storeys
    column, storey = (grid.reshape(-1) for grid in np.meshgrid(np.arange(columns), np.arange(storeys)))
    n = len(column)
    flat = start + right * (column * wide)[:, None]
    corner = np.column_stack([flat, house.floor_m + storey * tall])
    width, height, sill = house.window_m
    kind = np.full(n, WINDOW)
    opening = np.tile([(wide - width) / 2, sill, (wide + width) / 2, sill + height], (n, 1))
    kind[rng.random(n) < (_BLIND_YARDS if house.terrace and side == 2 else _BLIND_SHARE[side])] = BLANK
    if party:
        kind[:] = BLANK
    if side == 0:
        if house.shop:
            opening[storey == 0] = [0.2, 0.35, wide - 0.2, min(tall - 0.5, 2.7)]
            kind[storey == 0] = WINDOW
        door = (storey == 0) & (column == int(house.door_share * columns))
        kind[door] = DOOR
        opening[door] = [(wide - _DOOR_M[0]) / 2, 0.0, (wide + _DOOR_M[0]) / 2, _DOOR_M[1]]
    if wide < width + 0.3:
        kind[kind == WINDOW] = BLANK
    wall = np.full(n, material_index(house.wall))
    upper = Cells(
        corner, np.tile(right, (n, 1)), np.tile([wide, tall], (n, 1)), opening, kind, wall,
        np.full(n, material_index("door")),
    )  # fmt: skip
    plinth = "stone" if house.wall == "stone" else "concrete"
    lower = Cells(
        np.array([[*start, house.foot_m]]), right[None], np.array([[length, house.floor_m - house.foot_m]]),
        np.zeros((1, 4)), np.full(1, BLANK), np.full(1, material_index(plinth)), np.full(1, material_index("door")),
    )  # fmt: skip
    return [upper, lower]


def _rooms(house: House) -> Mesh:
    """Dark walls behind the panes and a ceiling and floor for every storey."""
    outer, inner = house.plot.corners(-0.02), house.plot.corners(-_ROOM_DEPTH_M)
    levels = house.floor_m + np.arange(house.storeys + 1) * house.storey_m
    points = [np.column_stack([inner, np.full(4, z)]) for z in (levels[0], levels[-1])]
    k = np.arange(4)
    m = (k + 1) % 4
    faces = [np.stack([k, m, m + 4], 1), np.stack([k, m + 4, k + 4], 1)]
    for level in levels:
        base = len(points) * 4
        points += [np.column_stack([outer, np.full(4, level)]), np.column_stack([inner, np.full(4, level)])]
        up = [np.stack([k, m, m + 4], 1) + base, np.stack([k, m + 4, k + 4], 1) + base]
        faces += up if level == levels[0] else [f[:, ::-1] for f in up]
    return Mesh.of(np.concatenate(points), np.concatenate(faces), "room_interior")


def _roofs(houses: list[House]) -> Mesh:
    """One instanced unit roof for every combination of shape and materials."""
    groups: dict[tuple[str, str, str, float, bool], list[np.ndarray]] = {}
    for house in houses:
        length, depth = house.plot.size_m
        turned = depth > length and not house.terrace  # the ridge runs along the longer side, or the street
        heading = house.plot.heading_rad + (np.pi / 2 if turned else 0.0)
        half = np.array([depth, length] if turned else [length, depth]) / 2
        ridge = round(float(np.clip(1.0 - half[1] / half[0], 0.05, 0.8)), 1) if house.roof == "hip" else 0.0
        position = np.array([[*house.plot.centre, house.eaves_m]])
        pose = poses(position, heading, np.array([[*half, house.roof_m]]))
        groups.setdefault((house.roof, house.tiles, house.wall, ridge, house.terrace), []).append(pose)
    parts = []
    for (kind, tiles, wall, ridge, terrace), placed in sorted(groups.items(), key=lambda item: item[0]):
        if kind == "gable":
            template = _gable_roof(tiles, wall, *_OVERHANG[terrace])
        elif kind == "hip":
            template = _hip_roof(tiles, ridge)
        else:
            template = _flat_roof("roof_flat", wall)
        parts.append(instances(clean(template), np.concatenate(placed)))
    return Mesh.merge(parts)


def _gable_roof(tiles: str, wall: str, verge: float, eaves: float) -> Mesh:
    """Two slopes over [−1, 1]² with the ridge along x at height 1; gable walls included.

    Args:
        tiles, wall: materials.
        verge, eaves: how far the roof reaches beyond the walls along and across the ridge, as a share.
    """
    over_x, over_y = 1.0 + verge, 1.0 + eaves
    eave = 1.0 - over_y
    roof = np.array([[s * over_x, y, z] for s in (-1, 1) for y, z in ((-over_y, eave), (0, 1), (over_y, eave))])
    slopes = [[0, 3, 4, 1], [1, 4, 5, 2]]
    walls = np.array([[-1, -1, 0], [-1, 1, 0], [-1, 0, 1], [1, -1, 0], [1, 1, 0], [1, 0, 1]], float)
    sides = Mesh.of(walls, np.array([[0, 2, 1], [3, 4, 5]]), wall)
    return Mesh.merge([_roof_slab(roof, slopes, tiles), sides])


def _hip_roof(tiles: str, ridge: float) -> Mesh:
    """Four slopes over [−1, 1]² with a ridge from x = −`ridge` to `ridge` at height 1."""
    over = 1.06
    eave = 1.0 - over
    roof = np.array(
        [
            [-over, -over, eave], [over, -over, eave], [over, over, eave], [-over, over, eave],
            [-ridge, 0, 1], [ridge, 0, 1],
        ]
    )  # fmt: skip
    return _roof_slab(roof, [[0, 1, 5, 4], [2, 3, 4, 5], [1, 2, 5], [3, 0, 4]], tiles)


def _flat_roof(cover: str, wall: str) -> Mesh:
    """A deck at height 0 inside a parapet that reaches height 1."""
    deck = Mesh.of(
        np.array([[-0.97, -0.97, 0.05], [0.97, -0.97, 0.05], [0.97, 0.97, 0.05], [-0.97, 0.97, 0.05]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
        cover,
    )
    sides = [box((2.0, 0.05, 1.0), (0, s * 0.975, 0.5), wall) for s in (-1, 1)] + [
        box((0.05, 1.92, 1.0), (s * 0.975, 0, 0.5), wall) for s in (-1, 1)
    ]
    return Mesh.merge([deck, *sides])


def _roof_slab(points: np.ndarray, polygons: list[list[int]], material: str) -> Mesh:
    """Upper faces, the same faces underneath, and the edge between them."""
    n = len(points)
    lower = points - [0.0, 0.0, _ROOF_THICKNESS]
    faces = [[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)]
    under = [[f[0] + n, f[2] + n, f[1] + n] for f in faces]
    edges = [(p[k], p[(k + 1) % len(p)]) for p in polygons for k in range(len(p))]
    rim = [(a, b) for a, b in edges if (b, a) not in edges]
    band = [t for a, b in rim for t in ([a + n, b + n, b], [a + n, b, a])]
    return clean(Mesh.of(np.concatenate([points, lower]), np.array(faces + under + band), material))


def _chimneys(houses: list[House], rng: np.random.Generator) -> Mesh:
    """Chimneys on pitched roofs, plant boxes on flat ones."""
    chimney, plant = [], []
    for house in houses:
        half = np.array(house.plot.size_m) / 2
        offset = rng.uniform(-0.5, 0.5, 2) * half
        xy = house.plot.centre + house.plot.along * offset[0] + house.plot.inward * offset[1]
        stands = np.array([[*xy, house.eaves_m]])
        if house.roof == "flat":
            plant.append(poses(stands, house.plot.heading_rad, rng.uniform(0.7, 1.5)))
        else:
            tall = np.array([[1.0, 1.0, house.roof_m + 0.8]])
            chimney.append(poses(stands, house.plot.heading_rad, tall))
    parts = []
    if chimney:
        parts.append(instances(box((0.6, 0.6, 1.0), (0, 0, 0.5), "brick"), np.concatenate(chimney)))
    if plant:
        parts.append(instances(box((2.4, 1.8, 1.6), (0, 0, 0.8), "steel_galvanised"), np.concatenate(plant)))
    return Mesh.merge(parts)


def entrances_mesh(houses: list[House], land_z: Heights, rng: np.random.Generator) -> Mesh:
    """Paths from the pavement to the doors and steps up to the ground floors."""
    homes = [house for house in houses if house.plot.setback_m > _LEAST_SETBACK_M]
    if not homes:
        return Mesh.empty()
    along = np.array([house.plot.along for house in homes])
    inward = np.array([house.plot.inward for house in homes])
    gate = np.array([house.plot.front for house in homes]) + along * [[house.door_m] for house in homes]
    door = gate + inward * [[house.plot.setback_m] for house in homes]
    paved = rng.random(len(homes)) < 0.6
    parts = []
    for material, chosen in (("paving", paved), ("cobble", ~paved)):
        parts.append(ribbons(gate[chosen], door[chosen], 1.4, lambda xy: land_z(xy) + _PATH_RISE_M, material))
    middle = door - inward * _DOORSTEP_M[1] / 2
    foot = land_z(middle) - 0.15
    tall = np.array([house.floor_m for house in homes]) - foot
    heading = np.array([house.plot.heading_rad for house in homes])
    size = np.column_stack([np.full(len(homes), _DOORSTEP_M[0]), np.full(len(homes), _DOORSTEP_M[1]), tall])
    step = box((1.0, 1.0, 1.0), (0.0, 0.0, 0.5), "concrete")
    parts.append(instances(step, poses(np.column_stack([middle, foot]), heading, size)[tall > 0.2]))
    return Mesh.merge(parts)
