"""The ground as one conforming triangulation of carriageway, pavement and terrain, and the materials of terrain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import Delaunay, KDTree
from shapely import Geometry

from assets.materials import material_index
from assets.world.roads.surfaces import Outlines
from assets.world.styles import TownStyle

ROAD_EDGE_M = 2.0  # edge length of carriageway triangles
# edge lengths of terrain's triangles, each up to a distance from the streets
_TERRAIN = ((1.5, 2.5), (3.0, 8.0), (5.0, 30.0), (12.0, np.inf))
_SHORTEST_M = 0.12

CARRIAGEWAY, PAVEMENT, TERRAIN = 0, 1, 2
_PATCH_M = 22.0  # size of soil or gravel patches
_PATCH_LEVEL = 0.72
_GREEN_FROM_M = 45.0  # beyond the outermost street the land is grass


@dataclass(frozen=True, eq=False)
class SurfacePlan:
    """The triangulated plan of a town.

    Attributes:
        triangles: Delaunay triangulation of all points.
        points: (n, 2) float64 world x, y.
        faces: (m, 3) counter-clockwise rows of `points`.
        zone: (m,) CARRIAGEWAY, PAVEMENT or TERRAIN.
    """

    triangles: Delaunay
    points: np.ndarray
    faces: np.ndarray
    zone: np.ndarray


def triangulate(outlines: Outlines, low: np.ndarray, high: np.ndarray) -> SurfacePlan:
    """Delaunay triangulation whose edges contain all outlines (Ruppert 1995: unencroached segments)."""
    paved = outlines.paved
    linework = shapely.union(shapely.boundary(outlines.carriageway), shapely.boundary(paved), grid_size=0.01)
    edge_points, midpoints = _unencroached(linework)
    clearance = KDTree(np.concatenate([edge_points, midpoints]))
    points = np.concatenate([edge_points, *_fill(paved, low, high, clearance)])
    triangles = Delaunay(points)
    faces = triangles.simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces = np.where((area < 0)[:, None], faces[:, ::-1], faces)[np.abs(area) > 1e-5]
    centre = points[faces].mean(1)
    shapely.prepare([outlines.carriageway, paved])
    zone = np.full(len(faces), TERRAIN, np.uint8)
    zone[shapely.contains_xy(paved, centre[:, 0], centre[:, 1])] = PAVEMENT
    zone[shapely.contains_xy(outlines.carriageway, centre[:, 0], centre[:, 1])] = CARRIAGEWAY
    return SurfacePlan(triangles, points, faces, zone)


def zone_borders(plan: SurfacePlan) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Directed edges between zones: start and end point rows, the zone on the left, the zone on the right.

    Every border edge appears twice, once from either side.
    """
    start = plan.faces.reshape(-1)
    end = np.roll(plan.faces, -1, axis=1).reshape(-1)
    zone = np.repeat(plan.zone, 3).astype(np.int64)
    n = len(plan.points)
    forward, backward = start.astype(np.int64) * n + end, end.astype(np.int64) * n + start
    order = np.argsort(forward)
    slot = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    twin = order[slot]
    paired = forward[twin] == backward
    border = paired & (zone != zone[twin])
    return start[border], end[border], zone[border], zone[twin][border]


def _unencroached(linework: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Points and midpoints of outline segments split until no point lies in a segment's diametral circle."""
    coordinates, line = shapely.get_coordinates(shapely.get_parts(linework), return_index=True)
    same = line[1:] == line[:-1]
    start, end = coordinates[:-1][same], coordinates[1:][same]
    count = np.maximum(1, np.ceil(np.linalg.norm(end - start, axis=1) / ROAD_EDGE_M)).astype(int)
    start, end = _subdivide(start, end, count)
    for _ in range(8):
        points = np.unique(np.concatenate([start, end]), axis=0)
        half = np.linalg.norm(end - start, axis=1) / 2
        nearest, _ = KDTree(points).query((start + end) / 2)
        encroached = (nearest < half * 0.999) & (half > _SHORTEST_M)
        if not encroached.any():
            break
        start, end = _subdivide(start, end, np.where(encroached, 2, 1))
    points = np.unique(np.concatenate([start, end]), axis=0)
    return points, (start + end) / 2


def _subdivide(start: np.ndarray, end: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Splits segment i into `count[i]` equal parts; shared ends stay bit-identical."""
    which = np.repeat(np.arange(len(start)), count)
    part = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    step = (end - start)[which] / count[which, None]
    first = np.round(start[which] + step * part[:, None], 6)
    last = np.round(start[which] + step * (part + 1)[:, None], 6)
    last = np.where((part == count[which] - 1)[:, None], end[which], last)
    return first, last


def _fill(paved: Geometry, low: np.ndarray, high: np.ndarray, clearance: KDTree) -> list[np.ndarray]:
    """Inner points: fine on paved ground, coarser on terrain, coarsest far from any street."""
    shapely.prepare(paved)
    around = np.asarray(shapely.bounds(paved))
    fine = _hexagonal(around[:2], around[2:], ROAD_EDGE_M)
    fine = fine[shapely.contains_xy(paved, fine[:, 0], fine[:, 1])]
    fine = fine[clearance.query(fine)[0] > 0.58 * ROAD_EDGE_M]
    parts = [fine]
    nearest = 0.58 * _TERRAIN[0][0]
    for edge, farthest in _TERRAIN:
        grid = _hexagonal(low, high, edge)
        distance = clearance.query(grid)[0]
        grid = grid[(distance > nearest) & (distance <= farthest)]
        parts.append(grid[~shapely.contains_xy(paved, grid[:, 0], grid[:, 1])])
        nearest = farthest
    return [*parts, _border(low, high, _TERRAIN[-1][0])]


def _border(low: np.ndarray, high: np.ndarray, edge_m: float) -> np.ndarray:
    """Points about `edge_m` apart around a rectangle."""
    nx, ny = np.ceil((high - low) / edge_m).astype(int) + 1
    x, y = np.linspace(low[0], high[0], nx), np.linspace(low[1], high[1], ny)[1:-1]
    across = [np.stack([x, np.full(nx, level)], axis=1) for level in (low[1], high[1])]
    along = [np.stack([np.full(ny - 2, level), y], axis=1) for level in (low[0], high[0])]
    return np.concatenate(across + along)


def _hexagonal(low: np.ndarray, high: np.ndarray, edge_m: float) -> np.ndarray:
    """Points of an equilateral triangle grid inside a rectangle."""
    x = np.arange(low[0] + edge_m / 2, high[0], edge_m)
    y = np.arange(low[1] + edge_m / 2, high[1] - edge_m / 3, edge_m * np.sqrt(0.75))
    xs, ys = np.meshgrid(x, y)
    xs[1::2] += edge_m / 2
    inside = xs <= high[0] - edge_m / 3
    return np.stack([xs[inside], ys[inside]], axis=1)


def terrain_materials(
    plan: SurfacePlan, style: TownStyle, town_low: np.ndarray, town_high: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Material row (t,) of every terrain triangle: the style's usual ground, patches, and fields outside.

    Args:
        plan: the triangulated plan.
        style: ground materials.
        town_low, town_high: (2,) corners around all streets, world metres.
        rng: source of the patches.
    """
    from scipy.ndimage import map_coordinates

    centre = plan.points[plan.faces[plan.zone == TERRAIN]].mean(1)
    low, high = plan.points.min(0), plan.points.max(0)
    cells = np.ceil((high - low) / _PATCH_M).astype(int) + 4
    noise = map_coordinates(rng.random(tuple(cells)), ((centre - low) / _PATCH_M).T + 1.0, order=1)
    usual, patch = (material_index(name) for name in style.ground)
    material = np.where(noise > _PATCH_LEVEL, patch, usual)
    outside = ((centre < town_low - _GREEN_FROM_M) | (centre > town_high + _GREEN_FROM_M)).any(1)
    field = np.where(noise > _PATCH_LEVEL, material_index("soil"), material_index("grass"))
    return np.where(outside, field, material).astype(np.uint8)
