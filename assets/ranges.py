"""Intervals from which values are drawn uniformly."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator


def _pair(value: Any) -> Any:
    return (value, value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _ordered(pair: tuple[float, float]) -> tuple[float, float]:
    low, high = pair
    if not (np.isfinite(low) and np.isfinite(high)):
        raise ValueError(f"[{low:g}, {high:g}] is not finite; give two numbers, minimum first")
    if low > high:
        raise ValueError(f"minimum {low:g} is above maximum {high:g}; write [{high:g}, {low:g}]")
    if low < 0:
        raise ValueError(f"minimum {low:g} is negative; give 0 or more")
    return pair


Range = Annotated[tuple[float, float], BeforeValidator(_pair), AfterValidator(_ordered)]
"""Minimum and maximum, neither negative; a single number is both."""

CountRange = Annotated[tuple[int, int], BeforeValidator(_pair), AfterValidator(_ordered)]
"""Smallest and largest count, neither negative; a single number is both."""


def draw(interval: tuple[float, float], rng: np.random.Generator) -> float:
    """Return a number from an interval, both ends possible."""
    return float(rng.uniform(*interval))


def draw_count(interval: tuple[int, int], rng: np.random.Generator) -> int:
    """Return a count from an interval, both ends possible."""
    return int(rng.integers(interval[0], interval[1] + 1))
