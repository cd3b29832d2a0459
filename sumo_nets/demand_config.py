"""Distributions of the number and kinds of road users, from which the demand of an episode is drawn."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from assets.ranges import CountRange, Range, draw, draw_count
from sumo_nets.recipe import Demand, KindShares


def _a_share(values: tuple[float, float]) -> tuple[float, float]:
    if values[1] > 1:
        raise ValueError(f"a share of {values[1]:g} is above 1; give 0 to 1")
    return values


class DemandConfig(BaseModel):
    """Distributions of an episode's population, around what is usual in its town.

    A range is written as [minimum, maximum], or as one number for a fixed value.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    driving: CountRange | None = Field(default=None, description="vehicles on the move; none: from driving_factor")
    parked: CountRange | None = Field(default=None, description="vehicles parked; none: from parked_factor")
    walking: CountRange | None = Field(default=None, description="people on foot; none: from walking_factor")
    driving_factor: Range = Field(
        default=(0.75, 1.3), description="vehicles on the move over what is usual in the town [1]"
    )
    parked_factor: Range = Field(default=(0.6, 1.2), description="parked vehicles over what is usual in the town [1]")
    walking_factor: Range = Field(default=(0.3, 2.0), description="people on foot over what is usual in the town [1]")
    beside_parked: Annotated[Range, AfterValidator(_a_share)] = Field(
        default=(0.0, 0.05),
        description="share of the parked vehicles with a person next to them [1]",
    )
    sitting: Annotated[Range, AfterValidator(_a_share)] = Field(
        default=(0.0, 0.1),
        description="share of the seats of benches, café tables and bus shelters with a person on them [1]",
    )
    trams: CountRange | None = Field(
        default=None, description="trams in a town with tram tracks; none: as usual in the town"
    )
    kinds: KindShares | None = Field(
        default=None, description="mean shares of the kinds on the move; none: the town's own"
    )
    kind_spread: float = Field(
        default=0.35,
        ge=0,
        le=3,
        description="standard deviation of the logarithm of each kind's share, except cars [1]",
    )

    @model_validator(mode="after")
    def _someone_drives(self) -> Self:
        if self.driving is not None and self.driving[1] == 0:
            raise ValueError("driving is 0: the ego vehicle is one of them; give at least 1")
        return self

    def draw(self, usual: Demand, rng: np.random.Generator) -> Demand:
        """Return the population of one episode.

        Args:
            usual: the town's own demand (`RECIPES[name].demand`); its times are kept.
            rng: source of every choice made here.
        """
        counts = {
            name: draw_count(fixed, rng) if fixed is not None else round(getattr(usual, name) * draw(factor, rng))
            for name, fixed, factor in (
                ("driving", self.driving, self.driving_factor),
                ("parked", self.parked, self.parked_factor),
                ("walking", self.walking, self.walking_factor),
            )
        }
        shares = (self.kinds or usual.kinds).model_dump()
        spread = np.exp(rng.normal(0.0, self.kind_spread, len(shares)))
        types = {kind: shares[kind] * (1.0 if kind == "car" else s) for kind, s in zip(shares, spread, strict=True)}
        if self.trams is not None and usual.trams > 0:
            counts["trams"] = draw_count(self.trams, rng)
        return usual.model_copy(update={**counts, "kinds": KindShares(**types)})
