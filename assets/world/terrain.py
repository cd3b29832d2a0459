"""Ground cover next to the streets."""

from __future__ import annotations

import numpy as np

from assets.materials import material_index
from assets.world.ground import TERRAIN, SurfacePlan
from assets.world.styles import TownStyle

_PATCH_M = 22.0  # size of soil or gravel patches
_PATCH_LEVEL = 0.72
_GREEN_FROM_M = 45.0  # beyond the outermost street the land is grass


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
