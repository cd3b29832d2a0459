"""Designs a house for every plot: size, storeys, roof, materials, windows and door."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from assets.world.buildings.plots import BuildingPlot
from assets.world.styles import TownStyle

_FOUNDATION_M = 0.6  # walls reach this far under the lowest ground


@dataclass(frozen=True, eq=False)
class House:
    """One building.

    Attributes:
        plot: plot of the house.
        foot_m, floor_m: world heights of the foundation's underside and the ground floor.
        storeys, storey_m: count and height.
        roof: `gable`, `hip` or `flat`.
        roof_m: height of the roof over the eaves.
        wall, tiles: materials.
        bay_m: distance of window axes.
        window_m: width and height of a window, and height of its sill.
        shop: shop windows at street level.
        terrace: side walls without windows.
        door_share: position of the street door along the front, 0–1.
    """

    plot: BuildingPlot
    foot_m: float
    floor_m: float
    storeys: int
    storey_m: float
    roof: str
    roof_m: float
    wall: str
    tiles: str
    bay_m: float
    window_m: tuple[float, float, float]
    shop: bool
    terrace: bool
    door_share: float

    @property
    def eaves_m(self) -> float:
        """World height of the top of the walls."""
        return self.floor_m + self.storeys * self.storey_m

    def bays(self, length_m: float) -> int:
        """Count of window axes on a wall."""
        return max(1, int((length_m - 0.4) / self.bay_m))

    @property
    def door_m(self) -> float:
        """Distance of the street door from the middle of the front, along the street."""
        length = self.plot.size_m[0]
        bays = self.bays(length)
        return (int(self.door_share * bays) + 0.5) * length / bays - length / 2


def design(
    plots: list[BuildingPlot], style: TownStyle, terrain_z: Callable[[np.ndarray], np.ndarray], rng: np.random.Generator
) -> list[House]:
    """Draws a house for every plot; `terrain_z` maps (n, 2) to world heights (n,)."""
    if not plots:
        return []
    ground_m = terrain_z(np.concatenate([plot.corners() for plot in plots])).reshape(-1, 4)
    return [_draw(plot, style, corners_m, rng) for plot, corners_m in zip(plots, ground_m, strict=True)]


def _draw(plot: BuildingPlot, style: TownStyle, ground_m: np.ndarray, rng: np.random.Generator) -> House:
    roof = str(rng.choice(style.roofs))
    short_side = min(plot.size_m)
    pitch = rng.uniform(0.55, 0.95) if roof == "gable" else rng.uniform(0.4, 0.75)
    roof_m = rng.uniform(0.4, 1.0) if roof == "flat" else min(pitch * short_side / 2, 5.5)
    sill = float(rng.uniform(0.75, 1.0))
    bay = float(rng.uniform(*style.bay_m))
    storey = float(rng.uniform(*style.storey_m))
    window = (
        float(min(rng.uniform(0.9, 1.5), bay - 0.9)),
        float(min(rng.uniform(1.2, 1.6), storey - sill - 0.45)),
        sill,
    )
    return House(
        plot=plot,
        foot_m=float(ground_m.min()) - _FOUNDATION_M,
        floor_m=float(ground_m[:2].mean() + 0.25 * (ground_m.max() - ground_m.min()) + rng.uniform(0.05, 0.3)),
        storeys=int(rng.integers(style.storeys[0], style.storeys[1] + 1)),
        storey_m=storey,
        roof=roof,
        roof_m=float(roof_m),
        wall=str(rng.choice(style.walls)),
        tiles=str(rng.choice(("roof_tile", "roof_tile", "roof_slate"))),
        bay_m=bay,
        window_m=window,
        shop=bool(rng.random() < style.shop_share),
        terrace=style.terrace,
        door_share=float(rng.random()),
    )
