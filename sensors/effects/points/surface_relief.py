"""Roughness of surfaces that are planes in the twin."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from sensors.effects.base import PointEffect, number
from sensors.effects.material_groups import GROUPS, Group, points_on_surface, rows_of_group
from sensors.effects.phases import Phase
from sensors.effects.spatial_noise import field_at
from sensors.returns import Returns
from sensors.shot import Shot

_GRAZING = 0.2  # beams at smaller grazing angles hit only the tops
_PLACE_M = 8.0  # cell of the field that makes places differ


class SurfaceRelief(PointEffect):
    """R − h/max(cosθ, 0.2), h = exp(v·u(p))·(σ_c·f(p/c) + σ_f·g(p/f)): displacement along the normal, fixed in space.

    The height of the texture of asphalt, grass or plaster is small compared with the range, so that the beam hits the
    displaced plane h/cosθ earlier. Streets differ: u changes over tens of metres, for example from new asphalt to old.
    """

    name: ClassVar = "surface_relief"
    phase: ClassVar = Phase.FOLIAGE
    channel: ClassVar = "range"
    equation: ClassVar = "R − h/max(cosθ, 0.2), h = exp(v·u(p))·(σ_c·f(p/c) + σ_f·g(p/f))"
    reference: ClassVar = "Cook: Shade trees, SIGGRAPH 1984 (displacement maps); ISO 13473 (texture of pavements)"
    taxonomy: ClassVar = "sp47"
    confusable_with: ClassVar = ("range_noise", "foliage_depth")
    needs_new_rays: ClassVar = True  # places on moving objects need their poses
    has_texture: ClassVar = True
    repeatable: ClassVar = True
    example: ClassVar = {
        "surfaces": "road",
        "coarse_sigma_m": 0.004,
        "coarse_m": 0.2,
        "fine_sigma_m": 0.002,
        "fine_m": 0.03,
    }
    is_candidate: ClassVar = False

    surfaces: Group = Field(description="group of materials")
    coarse_sigma_m: float = number("σ_c, height of the coarse relief", unit="m", ge=0, le=1)
    coarse_m: float = number("c, cell of the coarse relief", unit="m", ge=0.01, le=10)
    fine_sigma_m: float = number("σ_f, height of the fine relief", unit="m", ge=0, le=1)
    fine_m: float = number("f, cell of the fine relief", unit="m", ge=0.005, le=1)
    variation: float = Field(0.0, description="v, spread of the logarithm of the heights between places", ge=0, le=3)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns from the displaced surfaces."""
        rows = rows_of_group(self.surfaces, returns, shot)
        rough = returns.take(rows)
        places = points_on_surface(rough, shot)
        shift = 53 * (1 + GROUPS.index(self.surfaces))
        height = np.zeros(len(rows), np.float32)
        if self.coarse_sigma_m:
            height += np.float32(self.coarse_sigma_m) * field_at(places, self.coarse_m, (0, 0, shift))
        if self.fine_sigma_m:
            height += np.float32(self.fine_sigma_m) * field_at(places, self.fine_m, (shift, shift, 0))
        if self.variation:
            height *= np.exp(np.float32(self.variation) * field_at(places, _PLACE_M, (shift, 0, shift)))
        range_m = returns.range_m.copy()
        range_m[rows] -= height / np.maximum(shot.cos_incidence(rough), np.float32(_GRAZING))
        return replace(returns, range_m=np.maximum(range_m, np.float32(0.1)))
