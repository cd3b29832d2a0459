"""Builds designed houses: walls with windows, rooms behind the panes, roofs."""

from __future__ import annotations

import numpy as np

from assets.materials import material_index
from assets.mesh import Mesh
from assets.shapes import box, clean
from assets.world import roofs
from assets.world.facades import BLANK, DOOR, WINDOW, Cells, facade_mesh
from assets.world.houses import House
from assets.world.instancing import instances, poses

_ROOM_DEPTH_M = 0.6  # from the façade to the dark wall behind its panes
_DOOR_M = (1.0, 2.1)
_OVERHANG = {False: (0.03, 0.06), True: (0.0, 0.025)}  # of roofs, at verge and eaves, share of half the house
_BLIND_SHARE = (0.04, 0.5, 0.55, 0.5)  # bays without a window: front, right, back, left
_BLIND_YARDS = 0.9  # the same at the back of terraces, which streets do not see


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
            template = roofs.gable(tiles, wall, *_OVERHANG[terrace])
        elif kind == "hip":
            template = roofs.hip(tiles, ridge)
        else:
            template = roofs.flat("roof_flat", wall)
        parts.append(instances(clean(template), np.concatenate(placed)))
    return Mesh.merge(parts)


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
