"""How sure fitted parameters are: intervals that know that returns share errors, and that poses and objects are off."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from cosim.discrepancy.candidates import Unknown, with_values
from cosim.discrepancy.inference.fit import Fitted, Fitter, Free
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.projection import Projector
from cosim.discrepancy.inference.score import Column, ridged, stacked
from cosim.discrepancy.inference.search import likely_interval, widening
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


def covariances(fitter: Fitter, fitted: Fitted) -> list[np.ndarray]:
    """Covariances (p, p) of all free parameters, random effects eliminated.

    Of the model, and by sandwich (White 1980) of tracks and of scans.
    """
    if not fitted.columns:
        return [np.zeros((0, 0))]
    alone = LinearModel.of(fitter.random, (), fitted.evidence, fitted.prediction, fitted.estimate)
    columns = stacked(fitted.columns, fitted.evidence.score, len(fitter.sample))
    projected = Projector(alone, fitted.estimate, fitter.random.clusters, fitter.sample.share).project(columns)
    inverse = np.linalg.pinv(ridged(projected.information), hermitian=True)
    found = [inverse]
    for table in projected.tables:
        count = max(np.count_nonzero(np.abs(table).sum(1)), 2)
        found.append(inverse @ (table.T @ table) @ inverse * count / (count - 1))
    return found


def half_widths(fitter: Fitter, fitted: Fitted) -> np.ndarray:
    """Half widths of 95 % intervals, (p,): Student-t with as many degrees of freedom as scans."""
    freedom = max(len(fitter.sample.names) - 1, 1)
    widest = np.max([np.diag(one) for one in covariances(fitter, fitted)], axis=0)
    return np.sqrt(np.maximum(widest, 0)) * stats.t.ppf(fitter.settings.upper, freedom)


def _each(fitter: Fitter, fitted: Fitted) -> Iterator[tuple[Free, Column, np.ndarray]]:
    """What is free, its column, and half widths of its 95 % intervals."""
    widths, at = half_widths(fitter, fitted), 0
    for one, column in zip(fitted.free, fitted.columns, strict=True):
        yield one, column, widths[at : at + one.unknown.rings]
        at += one.unknown.rings


def intervals(fitter: Fitter, fitted: Fitted) -> dict[str, dict[str, Any]]:
    """95 % intervals of everything that was fitted, by effect and parameter: pairs, or lists of pairs."""
    found: dict[str, dict[str, Any]] = {}
    sought: dict[int, dict[Unknown, Column]] = {}
    for one, column, part in _each(fitter, fitted):
        effect = fitted.effects[one.effect]
        if fitter.is_searched(effect, one.unknown, column):
            sought.setdefault(one.effect, {})[one.unknown] = column
            continue
        value = np.asarray(getattr(effect, one.unknown.name), float)
        pair = np.stack([value - part, value + part], -1) if value.ndim else value + np.array([-part[0], part[0]])
        within = np.clip(pair, one.unknown.low, one.unknown.high)  # where others make up for it, all that may be
        found.setdefault(effect.name, {})[one.unknown.name] = within.tolist()
    for place, columns in sought.items():
        found.setdefault(fitted.effects[place].name, {}).update(_searched(fitter, fitted, place, columns))
    return found


def _searched(fitter: Fitter, fitted: Fitted, place: int, columns: dict[Unknown, Column]) -> dict[str, list[float]]:
    """Of parameters of one effect that no slope tells of: as scans and tracks are drawn anew.

    At jumps of the likelihood draws hardly scatter: there it must not have fallen too far, either.
    """
    effects, found = fitted.effects, {}
    lost, clusters = fitter.loss(fitted.estimate), (fitter.sample.frame, fitter.sample.track)
    held, drawn = dict[str, tuple[float, float]](), dict[str, Redrawn]()
    for unknown, column in columns.items():
        name, value = unknown.name, float(getattr(effects[place], unknown.name))
        pair = likely_interval(
            effects, place, unknown, column, lost, stray_weight(fitter, fitted), fitter.settings.search
        )

        def losses(at: float, name: str = name) -> np.ndarray:
            moved = with_values(effects[place], {name: at})
            return fitter.losses((*effects[:place], moved, *effects[place + 1 :]), fitted.estimate)

        apart = max((pair[1] - pair[0]) / 2, 1e-9)
        held[name] = pair
        drawn[name] = redrawn_interval(losses, value, apart, clusters, (unknown.low, unknown.high), fitter.settings)
    wider = widening(
        effects,
        place,
        {name: pair for name, pair in held.items() if drawn[name].is_smooth},
        lost,
        fitter.settings.search,
    )
    for unknown in columns:
        name, value = unknown.name, float(getattr(effects[place], unknown.name))
        one, by = drawn[name], wider.get(name, 1.0)
        aside = effects[place].sampled_to.get(name, 0.0) * abs(value)
        low, high = value - np.hypot((value - one.low) * by, aside), value + np.hypot((one.high - value) * by, aside)
        if not one.is_smooth:
            low, high = min(low, held[name][0]), max(high, held[name][1])
        found[name] = [float(max(low, unknown.low)), float(min(high, unknown.high))]
    return found


def stray_weight(fitter: Fitter, fitted: Fitted) -> float:
    """What a return from nowhere weighs on average in a sample whose beams weigh one."""
    sample = fitter.sample
    weight = sample.weight[sample.returned & sample.clear & (fitted.residuals.matched < 0.5)]
    own = float((weight**2).sum() / weight.sum()) if len(weight) else 1.0
    return own / sample.mean_weight
