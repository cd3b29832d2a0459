"""How sure fitted parameters are: intervals that know that returns share errors, and that poses and objects are off."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy import stats

from cosim.discrepancy.candidates import Unknown, amplitudes, with_values
from cosim.discrepancy.inference.cluster_bootstrap import Redrawn, redrawn_interval
from cosim.discrepancy.inference.columns import Column, ridged, stacked
from cosim.discrepancy.inference.fit import Fitted, Fitter, Free
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.score_test import Projector
from cosim.discrepancy.inference.search import likely_interval, widening
from sensors.effects.base import Effect


def covariances(fitter: Fitter, fitted: Fitted) -> list[np.ndarray]:
    """Covariances (p, p) of all free parameters, random effects eliminated.

    Of the model, and by sandwich (White 1980) of tracks and of scans.
    """
    if not fitted.columns:
        return [np.zeros((0, 0))]
    alone = LinearModel.of(fitter.random, (), fitted.evidence, fitted.prediction, fitted.estimate)
    columns = stacked(fitted.columns, fitted.evidence.score, len(fitter.sample))
    tables, information = Projector(alone, fitted.estimate, fitter.random.clusters).of(columns)
    inverse = np.linalg.pinv(ridged(information), hermitian=True)
    found = [inverse]
    for table in tables:
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


def plainly_on(fitter: Fitter, fitted: Fitted, given: Sequence[Effect]) -> frozenset[int]:
    """Places of effects so surely on that nothing else that is fitted can make up for them.

    Of those among the `given`, which come first: so surely other than they were given.
    """
    found = set()
    for one, column, part in _each(fitter, fitted):
        effect = fitted.effects[one.effect]
        before = vars(given[one.effect]) if one.effect < len(given) else type(effect).neutral
        name, is_searched = one.unknown.name, fitter.is_searched(effect, one.unknown, column)
        if before is None or name not in amplitudes(type(effect)) or is_searched:
            continue
        away = np.subtract(getattr(effect, name), before[name])
        if np.any(np.abs(away) > fitter.settings.search.plainly * part):
            found.add(one.effect)
    return frozenset(found)


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
    weight = sample.weight[sample.returned & sample.clear & (fitted.fit.matched < 0.5)]
    own = float((weight**2).sum() / weight.sum()) if len(weight) else 1.0
    return own / sample.mean_weight
