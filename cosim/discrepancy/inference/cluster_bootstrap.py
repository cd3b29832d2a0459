"""How far a searched parameter scatters when scans or tracks are drawn anew.

A cluster bootstrap (Cameron, Gelbach and Miller, Rev. Econ. Stat. 2008) that asks for no slopes: the likelihoods of all
beams at some values around the best are added up by cluster once, and every draw takes its own best value from them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from cosim.discrepancy.settings import DEFAULT, Settings


@dataclass(frozen=True)
class Redrawn:
    """A 95 % interval, and whether the likelihood there is about a parabola: one without jumps."""

    low: float
    high: float
    is_smooth: bool


def redrawn_interval(
    losses: Callable[[float], np.ndarray],
    value: float,
    apart: float,
    clusters: Sequence[np.ndarray],
    bounds: tuple[float, float],
    settings: Settings = DEFAULT,
) -> Redrawn:
    """Where the best value of a parameter comes to lie as clusters are drawn with replacement.

    Args:
        losses: negative log-likelihoods (n,) of all beams, as they are weighted, at a value.
        value: the best of all.
        apart: how far from it to look first; twice as far as long as draws end at the ends.
        clusters: of each kind, (n,) int which cluster every beam belongs to; the widest interval counts.
        bounds: of the parameter.
        settings: numbers that decide.
    """
    rng, by, upper = np.random.default_rng(0), settings.search, settings.upper
    drawn = [rng.multinomial(size, np.full(size, 1 / size), by.draws) for size in map(_size, clusters)]
    known: dict[float, list[np.ndarray]] = {}

    def sums(at: float) -> list[np.ndarray]:
        if at not in known:
            beams = losses(at)
            known[at] = [np.bincount(one, beams, _size(one)) for one in clusters]
        return known[at]

    for doubling in range(by.redoublings):
        grid = _around(value, apart * 2**doubling, bounds, by.side)
        table = [np.stack(columns, 1) for columns in zip(*map(sums, grid), strict=True)]
        best = [_best(weights @ one, by.level_to) for weights, one in zip(drawn, table, strict=True)]
        ends = [end for end in (0, -1) if bounds[0] < grid[end] < bounds[1]]
        if all(np.mean(one[:, end]) <= by.at_ends for one in best for end in ends):
            break
    low, high = value, value
    for one, likeliest in zip(clusters, best, strict=True):
        values, freedom = likeliest @ grid / likeliest.sum(1), max(_size(one) - 1, 1)
        wider = stats.t.ppf(upper, freedom) / stats.norm.ppf(upper) * np.sqrt((freedom + 1) / freedom)
        below, above = np.quantile(values, [1 - upper, upper])
        low, high = min(low, value + (below - value) * wider), max(high, value + (above - value) * wider)
    total = table[0].sum(0)
    return Redrawn(float(max(low, bounds[0])), float(min(high, bounds[1])), _is_parabola(grid, total, by.like_parabola))


def _best(losses: np.ndarray, level_to: float) -> np.ndarray:
    """(draws, values) bool: where they are least. Between two beams that tell the likelihood is level."""
    least = losses.min(1, keepdims=True)
    return losses <= least + level_to * np.abs(least)


def _around(value: float, reach: float, bounds: tuple[float, float], side: int) -> np.ndarray:
    """Values to both sides of one, within bounds; those of half the reach are among them."""
    return np.unique(np.clip(value + reach / side * np.arange(-side, side + 1), *bounds))


def _is_parabola(values: np.ndarray, losses: np.ndarray, share: float) -> bool:
    if len(values) < 4 or np.ptp(losses) == 0:
        return False
    away = (values - values.mean()) / np.ptp(values)
    left = losses - np.polyval(np.polyfit(away, losses, 2), away)
    return bool(left.var() <= (1 - share) * losses.var())


def _size(cluster: np.ndarray) -> int:
    return int(cluster.max(initial=0)) + 1
