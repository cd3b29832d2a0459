"""Garden path and step in front of a door."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box
from assets.world.houses import House
from assets.world.instancing import instances, poses
from assets.world.overlays import Heights, ribbons

_LEAST_SETBACK_M = 1.2  # doors nearer to the pavement open onto it
_PATH_RISE_M = 0.03
_STEP_M = (1.5, 0.8)


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
    middle = door - inward * _STEP_M[1] / 2
    foot = land_z(middle) - 0.15
    tall = np.array([house.floor_m for house in homes]) - foot
    heading = np.array([house.plot.heading_rad for house in homes])
    size = np.column_stack([np.full(len(homes), _STEP_M[0]), np.full(len(homes), _STEP_M[1]), tall])
    step = box((1.0, 1.0, 1.0), (0.0, 0.0, 0.5), "concrete")
    parts.append(instances(step, poses(np.column_stack([middle, foot]), heading, size)[tall > 0.2]))
    return Mesh.merge(parts)
