"""Properties that differ between episodes in the same town: density of buildings, plants and street furniture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from assets.ranges import Range, draw
from assets.world.styles import TownStyle

_LEAST = 0.05  # factors below it count as this


@dataclass(frozen=True)
class Environment:
    """One drawn environment.

    Attributes:
        props_per_100m: props per 100 m of sidewalk, for kinds whose density is set rather than the style's.
        prop_factors: density of every other kind over the style's own.
        building_density: houses per street front over the style's own.
        setback: distance of façades from the pavement over the style's own.
        vegetation: trees and bushes over the style's own.
    """

    props_per_100m: Mapping[str, float] = field(default_factory=dict)
    prop_factors: Mapping[str, float] = field(default_factory=dict)
    building_density: float = 1.0
    setback: float = 1.0
    vegetation: float = 1.0

    def density(self, kind: str, usual_per_100m: float) -> float:
        """Return the number of props of a kind per 100 m of sidewalk."""
        return self.props_per_100m.get(kind, usual_per_100m * self.prop_factors.get(kind, 1.0))

    def dress(self, style: TownStyle) -> TownStyle:
        """Return the style with gaps, set-backs and plants as dense as here."""
        sparse = 1.0 / max(self.building_density, _LEAST)
        gap = style.side_gap_m if style.terrace else (style.side_gap_m[0] * sparse, style.side_gap_m[1] * sparse)
        return replace(
            style,
            side_gap_m=gap,
            setback_m=(style.setback_m[0] * self.setback, style.setback_m[1] * self.setback),
            gap_share=min(style.gap_share * sparse**2, 0.95),
            meadow_chance=min(style.meadow_chance * sparse**2, 0.95),
            garden_trees=style.garden_trees * self.vegetation,
            street_tree_gap_m=style.street_tree_gap_m / max(self.vegetation, _LEAST),
            wild_trees=style.wild_trees * self.vegetation,
            garden_shrubs=style.garden_shrubs * self.vegetation,
            bed_gap_m=style.bed_gap_m / max(self.vegetation, _LEAST),
            climbers=min(style.climbers * self.vegetation, 1.0),
        )


class PropDensities(BaseModel):
    """Props per 100 m of sidewalk by kind; a kind without a range is as frequent as in towns of the style."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    litter_bin: Range | None = Field(default=None, description="litter bins at the kerb [per 100 m]")
    wheelie_bin: Range | None = Field(
        default=None, description="household bins at the back of the pavement [per 100 m]"
    )
    bench: Range | None = Field(default=None, description="benches facing the road [per 100 m]")
    table: Range | None = Field(default=None, description="café tables with chairs, on wide pavements [per 100 m]")
    box: Range | None = Field(default=None, description="piles of boxes and crates [per 100 m]")
    planter: Range | None = Field(default=None, description="bushes in tubs [per 100 m]")
    bicycle: Range | None = Field(default=None, description="parked bicycles [per 100 m]")
    bus_stop: Range | None = Field(default=None, description="bus shelters [per 100 m]")
    hydrant: Range | None = Field(default=None, description="fire hydrants [per 100 m]")
    fence: Range | None = Field(default=None, description="4 m pieces of guard rail at the kerb [per 100 m]")
    market_stall: Range | None = Field(default=None, description="market stalls, on wide pavements [per 100 m]")
    cabinet: Range | None = Field(default=None, description="distribution cabinets [per 100 m]")
    parking_meter: Range | None = Field(default=None, description="ticket machines at the kerb [per 100 m]")
    bollard: Range | None = Field(default=None, description="bollards at corners [per 100 m]")
    trailer: Range | None = Field(default=None, description="parked trailers of cars behind the pavement [per 100 m]")
    skip: Range | None = Field(default=None, description="open containers for rubble behind the pavement [per 100 m]")
    glass_bank: Range | None = Field(default=None, description="rows of containers for glass [per 100 m]")
    barrier: Range | None = Field(default=None, description="boards and cones of building sites [per 100 m]")
    scooter: Range | None = Field(default=None, description="parked motor scooters [per 100 m]")
    utility_pole: Range | None = Field(default=None, description="wooden poles of overhead lines [per 100 m]")
    advertising_pillar: Range | None = Field(default=None, description="round pillars for posters [per 100 m]")


PROP_KINDS: tuple[str, ...] = tuple(PropDensities.model_fields)


class EnvironmentConfig(BaseModel):
    """Distributions of a town's surroundings; every range is [minimum, maximum], or one number for a fixed value."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    props_per_100m: PropDensities = Field(
        default=PropDensities(), description="densities of single kinds of props [per 100 m]"
    )
    prop_factor: Range = Field(
        default=(0.3, 1.8),
        description="density of each other kind of prop over the style's own, drawn kind by kind [1]",
    )
    building_density: Range = Field(default=(0.8, 1.15), description="houses per street front over the style's own [1]")
    setback: Range = Field(
        default=(0.85, 1.25), description="distance of façades from the pavement over the style's own [1]"
    )
    vegetation: Range = Field(default=(0.6, 1.6), description="trees and bushes over the style's own [1]")

    def draw(self, rng: np.random.Generator) -> Environment:
        """Return one environment; `rng` is the source of every choice."""
        fixed = {kind: interval for kind, interval in self.props_per_100m if interval is not None}
        return Environment(
            props_per_100m={kind: draw(interval, rng) for kind, interval in fixed.items()},
            prop_factors={kind: draw(self.prop_factor, rng) for kind in PROP_KINDS if kind not in fixed},
            building_density=draw(self.building_density, rng),
            setback=draw(self.setback, rng),
            vegetation=draw(self.vegetation, rng),
        )
