"""Lines of fences, walls and hedges around gardens, and their meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.mesh import Mesh
from assets.world.borders.fences import OPEN_KINDS, PIECE_M, fences_mesh, line_of
from assets.world.buildings.houses import House
from assets.world.ground.overlays import Heights
from assets.world.obstacles import Obstacles
from assets.world.styles import TownStyle

_SIDE_SHARE = 0.75  # fenced plots with a border between neighbours too


@dataclass(frozen=True, eq=False)
class Borders:
    """Pieces of border in the plane, world metres.

    Attributes:
        kind: (n,) names out of `FENCE_KINDS`.
        start, end: (n, 2) start and end of each piece.
        rise: (n,) height over the usual one of the kind.
    """

    kind: np.ndarray
    start: np.ndarray
    end: np.ndarray
    rise: np.ndarray

    @staticmethod
    def of(lines: list[tuple[str, np.ndarray, float]]) -> Borders:
        """Pieces between consecutive knots (k, 2) of every line of one kind and rise."""
        if not lines:
            return Borders(np.zeros(0, "U1"), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
        count = [len(knots) - 1 for _, knots, _ in lines]
        return Borders(
            np.repeat([kind for kind, _, _ in lines], count),
            np.concatenate([knots[:-1] for _, knots, _ in lines]),
            np.concatenate([knots[1:] for _, knots, _ in lines]),
            np.repeat([rise for _, _, rise in lines], count),
        )

    def only(self, keep: np.ndarray) -> Borders:
        """The pieces of a mask (n,)."""
        return Borders(self.kind[keep], self.start[keep], self.end[keep], self.rise[keep])

    def mesh(self, stand_z: Heights, rng: np.random.Generator) -> Mesh:
        """The pieces on the ground `stand_z`."""
        if not len(self.kind):
            return Mesh.empty()
        piece_m = np.array([PIECE_M[name] for name in self.kind])
        poses = line_of(self.start, self.end, stand_z(self.start), stand_z(self.end), piece_m, self.rise)
        return fences_mesh(self.kind, poses, rng)


def knots_between(start: np.ndarray, end: np.ndarray, kind: str) -> np.ndarray:
    """Points (k, 2) from `start` to `end` about a piece of the kind apart."""
    count = max(1, round(float(np.linalg.norm(end - start)) / PIECE_M[kind]))
    return start + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - start)


def garden_borders(houses: list[House], blocked: Obstacles, style: TownStyle, rng: np.random.Generator) -> Borders:
    """Fences, walls and hedges around gardens, with a gate in front."""
    lines = []
    for house in houses:
        plot = house.plot
        if plot.setback_m < 1.0 or rng.random() > style.fence_share:
            continue
        half, back = plot.width_m / 2, plot.setback_m + plot.size_m[1] + rng.uniform(2.0, 6.0)
        gate = float(np.clip(house.door_m, 1.5 - half, half - 1.5))
        front, side, rear = str(rng.choice(style.fences)), str(rng.choice(OPEN_KINDS)), str(rng.choice(OPEN_KINDS))
        for kind, begin, end in (
            (front, (-half, 0.35), (gate - 1.1, 0.35)),
            (front, (gate + 1.1, 0.35), (half, 0.35)),
            (side, (-half, 0.5), (-half, back if rng.random() < _SIDE_SHARE else 0.6)),
            (rear, (-half, back), (half, back)),
        ):
            corner = np.array([begin, end])
            xy = plot.front + corner[:, :1] * plot.along + corner[:, 1:] * plot.inward
            if float(np.linalg.norm(xy[1] - xy[0])) >= 1.0 and corner[1, 0] >= corner[0, 0]:
                lines.append((kind, knots_between(xy[0], xy[1], kind), 1.0))
    borders = Borders.of(lines)
    return borders.only(~blocked.crosses(borders.start, borders.end))
