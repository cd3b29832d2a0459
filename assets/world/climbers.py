"""Climbing plants on the walls of houses."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.world.houses import House
from assets.world.instancing import instances
from assets.world.overlays import Heights
from assets.world.trees import climber

_VARIANTS = 4
_PATCH_M = ((1.5, 5.0), (1.8, 5.0))  # width and height
_SIDES = 3  # the front and the two side walls; terraced houses have only the front


def climbers_mesh(houses: list[House], stand_z: Heights, share: float, rng: np.random.Generator) -> Mesh:
    """A patch of leaves on a wall of some houses; `stand_z` gives the height of the ground."""
    patches = [
        climber(rng, float(rng.uniform(*_PATCH_M[0])), float(rng.uniform(*_PATCH_M[1]))) for _ in range(_VARIANTS)
    ]
    widths = [float(patch.vertices[:, 0].max()) for patch in patches]
    poses: list[list[np.ndarray]] = [[] for _ in patches]
    for house in houses:
        drawn, which, wall, position = (
            rng.random(),
            int(rng.integers(_VARIANTS)),
            int(rng.integers(_SIDES)),
            rng.random(),
        )
        if drawn >= share:
            continue
        corners = house.plot.corners()
        side = 0 if house.terrace else (0, 1, 3)[wall]
        start, end = corners[side], corners[(side + 1) % 4]
        length = float(np.linalg.norm(end - start))
        free = length - widths[which]
        if free <= 0:
            continue
        along = (end - start) / length
        pose = np.eye(4)
        pose[:2, 0], pose[:2, 1] = -along, [along[1], -along[0]]  # y out of the wall
        pose[:2, 3] = start + along * (position * free + widths[which])
        pose[2, 3] = float(stand_z(pose[None, :2, 3])[0])
        tallest = house.eaves_m - pose[2, 3]
        pose[2, 2] = min(1.0, tallest / float(patches[which].vertices[:, 2].max()))
        poses[which].append(pose)
    return Mesh.merge(
        [instances(patch, np.stack(subset)) for patch, subset in zip(patches, poses, strict=True) if subset]
    )
