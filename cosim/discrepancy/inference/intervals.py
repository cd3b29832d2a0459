"""95 % confidence intervals of fitted parameters that allow for correlated errors and for the random effects.

Differentiable parameters: sandwich covariance clustered by track and by scan. Others: cluster bootstrap over scans and
tracks, combined with likelihood intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from cosim.discrepancy.candidates import Unknown, with_values
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.parameters import Free, is_relative
from cosim.discrepancy.inference.projection import Projector
from cosim.discrepancy.inference.score import Column, ridged, stacked
from cosim.discrepancy.inference.search import interval_widening, likelihood_interval
from cosim.discrepancy.settings import DEFAULT, Settings

_REWEIGHTINGS = 5
_UNKNOWN = 1e12  # variance of parameters without information


@dataclass(frozen=True)
class BootstrapInterval:
    """A 95 % bootstrap interval.

    Attributes:
        low, high: limits of the interval, in the unit of the parameter.
        is_smooth: whether the log-likelihood is approximately a parabola there, without jumps.
    """

    low: float
    high: float
    is_smooth: bool


def bootstrap_interval(
    losses: Callable[[float], np.ndarray],
    value: float,
    apart: float,
    clusters: Sequence[np.ndarray],
    bounds: tuple[float, float],
    settings: Settings = DEFAULT,
) -> BootstrapInterval:
    """Cluster bootstrap of a parameter's maximum-likelihood value.

    Args:
        losses: weighted negative log-likelihoods (n,) of all beams as a function of the value.
        value: maximum-likelihood value.
        apart: half width of the grid of trial values; doubled while draws have their optimum at its ends.
        clusters: for each kind of cluster, (n,) int cluster of each beam; the widest interval is returned.
        bounds: lower and upper bound of the parameter.
        settings: settings of the intervals.
    """
    rng, by, upper = np.random.default_rng(0), settings.search, settings.upper
    draws = [rng.multinomial(size, np.full(size, 1 / size), by.draws) for size in map(_count, clusters)]
    cache: dict[float, list[np.ndarray]] = {}

    def sum_losses(at: float) -> list[np.ndarray]:
        if at not in cache:
            beams = losses(at)
            cache[at] = [np.bincount(cluster, beams, _count(cluster)) for cluster in clusters]
        return cache[at]

    for doubling in range(by.redoublings):
        grid = _grid(value, apart * 2**doubling, bounds, by.side)
        table = [np.stack(columns, 1) for columns in zip(*map(sum_losses, grid), strict=True)]
        optima = [
            _is_optimal(weights @ losses_of_value, by.level_to)
            for weights, losses_of_value in zip(draws, table, strict=True)
        ]
        ends = [end for end in (0, -1) if bounds[0] < grid[end] < bounds[1]]
        if all(np.mean(mask[:, end]) <= by.at_ends for mask in optima for end in ends):
            break
    low, high = value, value
    for cluster, is_optimal in zip(clusters, optima, strict=True):
        values, freedom = is_optimal @ grid / is_optimal.sum(1), max(_count(cluster) - 1, 1)
        wider = stats.t.ppf(upper, freedom) / stats.norm.ppf(upper) * np.sqrt((freedom + 1) / freedom)
        below, above = np.quantile(values, [1 - upper, upper])
        low, high = min(low, value + (below - value) * wider), max(high, value + (above - value) * wider)
    total = table[0].sum(0)
    return BootstrapInterval(
        float(max(low, bounds[0])), float(min(high, bounds[1])), _is_parabola(grid, total, by.like_parabola)
    )


def _is_optimal(losses: np.ndarray, level_to: float) -> np.ndarray:
    """(draws, values) bool whether each value is optimal; several are if the likelihood is constant between beams."""
    least = losses.min(1, keepdims=True)
    return losses <= least + level_to * np.abs(least)


def _grid(value: float, reach: float, bounds: tuple[float, float], side: int) -> np.ndarray:
    """Grid of values around `value` within the bounds; the grid of half the reach is contained in it."""
    return np.unique(np.clip(value + reach / side * np.arange(-side, side + 1), *bounds))


def _is_parabola(values: np.ndarray, losses: np.ndarray, share: float) -> bool:
    if len(values) < 4 or np.ptp(losses) == 0:
        return False
    away = (values - values.mean()) / np.ptp(values)
    left = losses - np.polyval(np.polyfit(away, losses, 2), away)
    return bool(left.var() <= (1 - share) * losses.var())


def _count(cluster: np.ndarray) -> int:
    return int(cluster.max(initial=0)) + 1


def covariances(fitter: Fitter, fitted: Fitted) -> list[np.ndarray]:
    """Covariances (p, p) of all free parameters with the random effects eliminated.

    Model-based (inverse information), and sandwich estimates (White 1980) clustered by tracks and by scans.
    """
    if not fitted.columns:
        return [np.zeros((0, 0))]
    model = LinearModel.of(fitter.random, (), fitted.evidence, fitted.prediction, fitted.estimate)
    columns = stacked(fitted.columns, fitted.evidence.score, len(fitter.sample))
    least_left = fitter.settings.selection.least_left
    projector = Projector(model, fitted.estimate, fitter.random.clusters, fitter.sample.share, least_left)
    projected = projector.project(columns)
    inverse = np.linalg.pinv(ridged(projected.information), hermitian=True)
    inverse += np.diag(np.where(np.diag(projected.information) > 0, 0.0, _UNKNOWN))  # where no beam says anything
    estimates = [inverse]
    for table in projected.tables:
        count = max(np.count_nonzero(np.abs(table).sum(1)), 2)
        estimates.append(inverse @ (table.T @ table) @ inverse * count / (count - 1))
    return estimates


def half_widths(fitter: Fitter, fitted: Fitted) -> np.ndarray:
    """Half widths (p,) of 95 % intervals: Student-t with (scans − 1) degrees of freedom."""
    freedom = max(len(fitter.sample.names) - 1, 1)
    widest = np.max([_variances(covariance, fitter, fitted) for covariance in covariances(fitter, fitted)], axis=0)
    return np.sqrt(np.maximum(widest, 0)) * stats.t.ppf(fitter.settings.upper, freedom)


def _variances(covariance: np.ndarray, fitter: Fitter, fitted: Fitted) -> np.ndarray:
    """Variances (p,) of parameters; of gains relative to their mean where only these can be determined."""
    variances, at = np.diag(covariance).copy(), 0
    for one in fitted.free:
        part = slice(at, at + one.unknown.rings)
        if is_relative(fitted.effects, one, fitter.sample.of_own_map):
            gains = np.asarray(getattr(fitted.effects[one.effect], one.unknown.name), float)
            variances[part] = _relative_variances(covariance[part, part], gains)
        at += one.unknown.rings
    return variances


def _relative_variances(covariance: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Variances (k,) of gains relative to their mean, in which well determined gains have large weights."""
    variances = np.diag(covariance)
    weight = 1 / np.maximum(variances, 1e-12)
    for _ in range(_REWEIGHTINGS):
        relative = np.eye(len(gains)) - np.outer(gains, weight) / float(gains @ weight)
        variances = np.diag(relative @ covariance @ relative.T)
        weight = 1 / np.maximum(variances, 1e-12)
    return variances


def _free_parameters(fitter: Fitter, fitted: Fitted) -> Iterator[tuple[Free, Column, np.ndarray]]:
    """Iterate over free parameters, their columns and the half widths of their 95 % intervals."""
    widths, at = half_widths(fitter, fitted), 0
    for parameter, column in zip(fitted.free, fitted.columns, strict=True):
        yield parameter, column, widths[at : at + parameter.unknown.rings]
        at += parameter.unknown.rings


def intervals(fitter: Fitter, fitted: Fitted) -> dict[str, dict[str, Any]]:
    """95 % intervals of all fitted parameters by effect and parameter name: pairs, or lists of pairs."""
    intervals_by_effect: dict[str, dict[str, Any]] = {}
    searched: dict[int, dict[Unknown, Column]] = {}
    for parameter, column, part in _free_parameters(fitter, fitted):
        effect = fitted.effects[parameter.effect]
        if fitter.is_searched(effect, parameter.unknown, column):
            searched.setdefault(parameter.effect, {})[parameter.unknown] = column
            continue
        value = np.asarray(getattr(effect, parameter.unknown.name), float)
        pair = np.stack([value - part, value + part], -1) if value.ndim else value + np.array([-part[0], part[0]])
        within = np.clip(pair, parameter.unknown.low, parameter.unknown.high)  # clipped to the parameter's bounds
        intervals_by_effect.setdefault(effect.name, {})[parameter.unknown.name] = within.tolist()
    for index, columns in searched.items():
        intervals_by_effect.setdefault(fitted.effects[index].name, {}).update(
            _bootstrap_intervals(fitter, fitted, index, columns)
        )
    return intervals_by_effect


def _bootstrap_intervals(
    fitter: Fitter, fitted: Fitted, index: int, columns: dict[Unknown, Column]
) -> dict[str, list[float]]:
    """Intervals of the searched parameters of one effect, by cluster bootstrap over scans and over tracks.

    At a discontinuity of the likelihood bootstrap draws barely vary; there the interval is at least the likelihood
    interval.
    """
    effects, limits = fitted.effects, {}
    lost, clusters = fitter.loss(fitted.estimate), (fitter.sample.frame, fitter.sample.track)
    likely, bootstrap = dict[str, tuple[float, float]](), dict[str, BootstrapInterval]()
    for unknown, column in columns.items():
        name, value = unknown.name, float(getattr(effects[index], unknown.name))
        pair = likelihood_interval(
            effects, index, unknown, column, lost, spurious_weight(fitter, fitted), fitter.settings.search
        )

        def losses(at: float, name: str = name) -> np.ndarray:
            moved = with_values(effects[index], {name: at})
            return fitter.losses((*effects[:index], moved, *effects[index + 1 :]), fitted.estimate)

        apart = max((pair[1] - pair[0]) / 2, 1e-9)
        likely[name] = pair
        bootstrap[name] = bootstrap_interval(
            losses, value, apart, clusters, (unknown.low, unknown.high), fitter.settings
        )
    widenings = interval_widening(
        effects,
        index,
        {name: pair for name, pair in likely.items() if bootstrap[name].is_smooth},
        lost,
        fitter.settings.search,
    )
    for unknown in columns:
        name, value = unknown.name, float(getattr(effects[index], unknown.name))
        interval, factor = bootstrap[name], widenings.get(name, 1.0)
        # `sampled_to` is a standard error; the interval needs its quantile.
        sampling_error = float(stats.norm.ppf(fitter.settings.upper)) * effects[index].sampled_to.get(name, 0.0) * value
        low, high = (
            value - np.hypot((value - interval.low) * factor, sampling_error),
            value + np.hypot((interval.high - value) * factor, sampling_error),
        )
        if not interval.is_smooth:
            low, high = min(low, likely[name][0]), max(high, likely[name][1])
        limits[name] = [float(max(low, unknown.low)), float(min(high, unknown.high))]
    return limits


def spurious_weight(fitter: Fitter, fitted: Fitted) -> float:
    """Effective mean weight of a spurious return in a sample with mean weight 1."""
    sample = fitter.sample
    weight = sample.weight[sample.returned & sample.clear & (fitted.residuals.matched < 0.5)]
    own = float((weight**2).sum() / weight.sum()) if len(weight) else 1.0
    return own / sample.mean_weight
