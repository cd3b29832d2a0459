"""From plan to ground mesh: each zone at its height over the common sheet, kerbs between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Geometry

from assets.materials import material_index
from assets.mesh import Mesh
from assets.world.ground.overlays import ribbons
from assets.world.ground.plan import CARRIAGEWAY, PAVEMENT, ROAD_EDGE_M, TERRAIN, SurfacePlan, zone_borders
from assets.world.ground.sheet import Sheet

KERB_M = 0.12
LOWERED_KERB_M = 0.02  # at crossings
TERRAIN_RISE_M = 0.06  # over the carriageway, so 6 cm under the pavement
_STONE_M, _STONE_RISE_M = 0.14, 0.003
_RAMP_M = (0.2, 1.4)  # distances from a crossing between which the kerb rises to full height


@dataclass(frozen=True, eq=False)
class TerrainRelief:
    """Height of each zone above the common surface.

    Attributes:
        height: the sheet H, (n, 2) → (n,), metres; the carriageway lies on it.
        crossings: where kerbs are lowered.
    """

    height: Sheet
    crossings: Geometry

    def rise_m(self, points: np.ndarray, zone: int) -> np.ndarray:
        """Rise (n,) of a zone over H at points (n, 2)."""
        if zone == CARRIAGEWAY:
            return np.zeros(len(points))
        if zone == TERRAIN:
            return np.full(len(points), TERRAIN_RISE_M)
        if shapely.is_empty(self.crossings):
            return np.full(len(points), KERB_M)
        away = np.full(len(points), _RAMP_M[1])
        shapely.prepare(self.crossings)
        spots = np.asarray(shapely.points(points[:, :2]))
        near = shapely.dwithin(self.crossings, spots, _RAMP_M[1])
        away[near] = shapely.distance(self.crossings, spots[near])
        ramp = np.clip((away - _RAMP_M[0]) / (_RAMP_M[1] - _RAMP_M[0]), 0.0, 1.0)
        return LOWERED_KERB_M + (KERB_M - LOWERED_KERB_M) * ramp

    def z(self, points: np.ndarray, zone: int) -> np.ndarray:
        """World height (n,) of a zone at points (n, 2)."""
        return self.height(points) + self.rise_m(points, zone)

    def z_of_land(self, points: np.ndarray, pavement: Geometry) -> np.ndarray:
        """World height (n,) of pavement or terrain, whichever is at points (n, 2)."""
        shapely.prepare(pavement)
        paved = shapely.contains_xy(pavement, points[:, 0], points[:, 1])
        return np.where(paved, self.z(points, PAVEMENT), self.z(points, TERRAIN))


def kerb_stones(plan: SurfacePlan, relief: TerrainRelief) -> Mesh:
    """The stones' upper faces: a strip along the pavement's edge, 3 mm proud."""
    start, end, zone, other = zone_borders(plan)
    edge = (zone == CARRIAGEWAY) & (other == PAVEMENT)
    first, last = plan.points[start[edge]], plan.points[end[edge]]
    run = last - first
    away = run[:, ::-1] * [1.0, -1.0] / np.maximum(np.linalg.norm(run, axis=1, keepdims=True), 1e-6)
    middle = away * _STONE_M / 2
    return ribbons(
        first + middle, last + middle, _STONE_M, lambda xy: relief.z(xy, PAVEMENT) + _STONE_RISE_M, "kerb", ROAD_EDGE_M
    )  # as long as the triangles that they lie on


def ground_mesh(plan: SurfacePlan, relief: TerrainRelief, terrain_materials: np.ndarray) -> Mesh:
    """Carriageway, pavement, terrain and the vertical kerbs between them.

    Args:
        plan: the triangulated plan, whose points are those of the sheet.
        relief: heights of the zones.
        terrain_materials: (t,) material row of each terrain triangle, in the plan's order.
    """
    heights = np.stack([relief.height.z + relief.rise_m(plan.points, zone) for zone in range(3)])
    materials = np.array([material_index("asphalt"), material_index("paving"), 0], np.uint8)[plan.zone]
    materials[plan.zone == TERRAIN] = terrain_materials
    vertices = np.concatenate([np.column_stack([plan.points, z]) for z in heights])
    faces = plan.faces + plan.zone[:, None].astype(np.int64) * len(plan.points)
    everything = np.ones(len(faces), bool)
    tops = Mesh(vertices, faces, materials).select(everything)
    return Mesh.merge([tops, _kerbs(plan, heights)])


def _kerbs(plan: SurfacePlan, heights: np.ndarray) -> Mesh:
    """Vertical faces wherever two zones meet, facing the lower one."""
    start, end, zone, other = zone_borders(plan)
    top = np.stack([heights[zone, start], heights[zone, end]], axis=1)
    foot = np.stack([heights[other, start], heights[other, end]], axis=1)
    higher = top.sum(1) > foot.sum(1)
    start, end, top, foot = start[higher], end[higher], top[higher], foot[higher]
    corners = [
        np.column_stack([plan.points[start], foot[:, 0]]),
        np.column_stack([plan.points[end], foot[:, 1]]),
        np.column_stack([plan.points[end], top[:, 1]]),
        np.column_stack([plan.points[start], top[:, 0]]),
    ]
    n = len(start)
    quads = np.arange(4 * n).reshape(4, n).T
    return Mesh.of(np.concatenate(corners), quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), "kerb")
