"""Distributions that a user writes into a configuration."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

_TRIES = 100


class _Distribution(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Constant(_Distribution):
    """Always the same."""

    kind: Literal["constant"] = "constant"
    value: float = Field(description="the value", allow_inf_nan=False)

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value."""
        return self.value, self.value

    def draw(self, rng: np.random.Generator) -> float:
        """The value."""
        return self.value


class Uniform(_Distribution):
    """Uniform distribution between two bounds."""

    kind: Literal["uniform"] = "uniform"
    min: float = Field(description="smallest value", allow_inf_nan=False)
    max: float = Field(description="largest value", allow_inf_nan=False)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        _demand_order(self.min, self.max)
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value."""
        return self.min, self.max

    def draw(self, rng: np.random.Generator) -> float:
        """One value."""
        return float(rng.uniform(self.min, self.max))


class Normal(_Distribution):
    """A normal distribution of which only what lies within bounds is drawn."""

    kind: Literal["normal"] = "normal"
    mean: float = Field(description="mean before truncation", allow_inf_nan=False)
    sigma: float = Field(ge=0, description="standard deviation before truncation", allow_inf_nan=False)
    min: float = Field(description="smallest value", allow_inf_nan=False)
    max: float = Field(description="largest value", allow_inf_nan=False)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        _demand_order(self.min, self.max)
        if self.mean + 5 * self.sigma < self.min or self.mean - 5 * self.sigma > self.max:
            raise ValueError(
                f"mean {self.mean:g} lies over five sigma outside {self.min:g} to {self.max:g}; move it or the bounds"
            )
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value."""
        return self.min, self.max

    def draw(self, rng: np.random.Generator) -> float:
        """Draw a value, again if it is out of bounds; after many attempts the nearest bound is returned."""
        for _ in range(_TRIES):
            value = float(rng.normal(self.mean, self.sigma))
            if self.min <= value <= self.max:
                return value
        return float(np.clip(self.mean, self.min, self.max))


class Choice(_Distribution):
    """One of some values."""

    kind: Literal["choice"] = "choice"
    values: tuple[float, ...] = Field(min_length=1, description="what may be drawn")
    weights: tuple[float, ...] | None = Field(None, description="relative frequencies; default: equal")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.weights is not None:
            if len(self.weights) != len(self.values):
                raise ValueError(f"{len(self.values)} values have {len(self.weights)} weights; give one each")
            if min(self.weights) < 0 or sum(self.weights) <= 0:
                raise ValueError("weights must not be negative, and one must be positive")
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value."""
        return min(self.values), max(self.values)

    def draw(self, rng: np.random.Generator) -> float:
        """One of the values."""
        weights = None if self.weights is None else np.array(self.weights) / sum(self.weights)
        return float(rng.choice(np.array(self.values), p=weights))


Distribution = Annotated[Constant | Uniform | Normal | Choice, Field(discriminator="kind")]


def within(lowest: float, highest: float) -> AfterValidator:
    """A check that nothing outside two bounds is ever drawn."""

    def check(value: Constant | Uniform | Normal | Choice) -> Constant | Uniform | Normal | Choice:
        low, high = value.bounds
        if low < lowest or high > highest:
            raise ValueError(f"draws {low:g} to {high:g}, but only {lowest:g} to {highest:g} is possible; narrow it")
        return value

    return AfterValidator(check)


def _demand_order(low: float, high: float) -> None:
    if low > high:
        raise ValueError(f"min {low:g} is above max {high:g}; swap them")
