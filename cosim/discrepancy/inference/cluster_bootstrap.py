"""How far a searched parameter scatters when scans or tracks are drawn anew.

A cluster bootstrap (Cameron, Gelbach and Miller, Rev. Econ. Stat. 2008) that asks for no slopes: the likelihoods of all
beams at some values around the best are added up by cluster once, and every draw takes its own best value from them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from cosim.discrepancy.settings import DEFAULT

_DRAWS = 400
_SIDE = 8  # values to each side of the best
_DOUBLINGS = 20
_AT_ENDS = 0.04  # of the draws
_LEVEL_TO = 1e-12
_LIKE_PARABOLA = 0.98


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
) -> Redrawn:
    """Where the best value of a parameter comes to lie as clusters are drawn with replacement.

    Args:
        losses: negative log-likelihoods (n,) of all beams, as they are weighted, at a value.
        value: the best of all.
        apart: how far from it to look first; twice as far as long as draws end at the ends.
        clusters: of each kind, (n,) int which cluster every beam belongs to; the widest interval counts.
        bounds: of the parameter.
    """
    rng = np.random.default_rng(0)
    drawn = [rng.multinomial(size, np.full(size, 1 / size), _DRAWS) for size in map(_size, clusters)]
    known: dict[float, list[np.ndarray]] = {}

    def sums(at: float) -> list[np.ndarray]:
        if at not in known:
            beams = losses(at)
            known[at] = [np.bincount(one, beams, _size(one)) for one in clusters]
        return known[at]

    for doubling in range(_DOUBLINGS):
        grid = _around(value, apart * 2**doubling, bounds)
        table = [np.stack(columns, 1) for columns in zip(*map(sums, grid), strict=True)]
        best = [_best(weights @ one) for weights, one in zip(drawn, table, strict=True)]
        ends = [end for end in (0, -1) if bounds[0] < grid[end] < bounds[1]]
        if all(np.mean(one[:, end]) <= _AT_ENDS for one in best for end in ends):
            break
    low, high = value, value
    for one, likeliest in zip(clusters, best, strict=True):
        values, freedom = likeliest @ grid / likeliest.sum(1), max(_size(one) - 1, 1)
        wider = stats.t.ppf(DEFAULT.upper, freedom) / stats.norm.ppf(DEFAULT.upper) * np.sqrt((freedom + 1) / freedom)
        below, above = np.quantile(values, [1 - DEFAULT.upper, DEFAULT.upper])
        low, high = min(low, value + (below - value) * wider), max(high, value + (above - value) * wider)
    total = table[0].sum(0)
    return Redrawn(float(max(low, bounds[0])), float(min(high, bounds[1])), _is_parabola(grid, total))


def _best(losses: np.ndarray) -> np.ndarray:
    """(draws, values) bool: where they are least. Between two beams that tell the likelihood is level."""
    least = losses.min(1, keepdims=True)
    return losses <= least + _LEVEL_TO * np.abs(least)


def _around(value: float, reach: float, bounds: tuple[float, float]) -> np.ndarray:
    """Values to both sides of one, within bounds; those of half the reach are among them."""
    return np.unique(np.clip(value + reach / _SIDE * np.arange(-_SIDE, _SIDE + 1), *bounds))


def _is_parabola(values: np.ndarray, losses: np.ndarray) -> bool:
    if len(values) < 4 or np.ptp(losses) == 0:
        return False
    away = (values - values.mean()) / np.ptp(values)
    left = losses - np.polyval(np.polyfit(away, losses, 2), away)
    return bool(left.var() <= (1 - _LIKE_PARABOLA) * losses.var())


def _size(cluster: np.ndarray) -> int:
    return int(cluster.max(initial=0)) + 1
