"""How sure fitted parameters are: intervals that know that returns share errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse, stats

from cosim.discrepancy.candidates import Unknown, with_values
from cosim.discrepancy.inference.cluster_bootstrap import Redrawn, redrawn_interval
from cosim.discrepancy.inference.columns import Column, Normal
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.search import is_searched, likely_interval, widening

_LEVEL = 0.975


def standard_errors(fitter: Fitter, fitted: Fitted) -> np.ndarray:
    """Standard errors of all free parameters, (p,): the widest of `covariances`."""
    return np.sqrt(np.max([np.diag(one) for one in covariances(fitter, fitted)], axis=0))


def covariances(fitter: Fitter, fitted: Fitted) -> list[np.ndarray]:
    """Covariances (p, p) of all free parameters by sandwich (White 1980): of no clusters, of tracks and of scans."""
    sample, columns = fitter.sample, fitted.columns
    poses = fitter.slopes(fitted.pose, fitted.prediction)
    normal = Normal.of(columns, fitted.evidence, poses)
    count = normal.parameters
    if not count:
        return [np.zeros((0, 0))]
    precision = np.append(np.zeros(count), fitter.precision(fitted.pose_sigma))
    matrix = normal.matrix + np.diag(precision + 1e-9 * np.diag(normal.matrix) + 1e-12)
    inverse = np.linalg.inv(matrix)
    rows = len(sample)
    influence = np.zeros((rows, count))
    for quantity, score in fitted.evidence.score.items():
        parts = [column.matrix(quantity, rows) for column in columns]
        parts.append(poses if quantity == "range" else sparse.csr_matrix(poses.shape))
        influence += score[:, None] * (sparse.hstack(parts, format="csr") @ inverse[:, :count])
    found = [influence.T @ influence]
    for cluster in (sample.track, sample.frame):
        size = int(cluster.max(initial=0)) + 1
        hot = sparse.csr_matrix((np.ones(rows), (cluster, np.arange(rows))), (size, rows))
        sums = hot @ influence
        found.append(sums.T @ sums * size / max(size - 1, 1))
    return found


def half_widths(fitter: Fitter, fitted: Fitted) -> np.ndarray:
    """Half widths of 95 % intervals, (p,): Student-t with as many degrees of freedom as scans."""
    freedom = max(len(fitter.sample.names) - 1, 1)
    return standard_errors(fitter, fitted) * stats.t.ppf(_LEVEL, freedom)


def intervals(fitter: Fitter, fitted: Fitted) -> dict[str, dict[str, Any]]:
    """95 % intervals of everything that was fitted, by effect and parameter: pairs, or lists of pairs."""
    widths, found, at = half_widths(fitter, fitted), {}, 0
    searched: dict[int, dict[Unknown, Column]] = {}
    for one, column in zip(fitted.free, fitted.columns, strict=True):
        part = widths[at : at + one.unknown.rings]
        at += one.unknown.rings
        effect = fitted.effects[one.effect]
        if is_searched(effect, one.unknown, column):
            searched.setdefault(one.effect, {})[one.unknown] = column
            continue
        value = np.asarray(getattr(effect, one.unknown.name), float)
        pair = np.stack([value - part, value + part], -1) if value.ndim else value + np.array([-part[0], part[0]])
        found.setdefault(effect.name, {})[one.unknown.name] = pair.tolist()
    for place, columns in searched.items():
        found.setdefault(fitted.effects[place].name, {}).update(_searched(fitter, fitted, place, columns))
    return found


def _searched(fitter: Fitter, fitted: Fitted, place: int, columns: dict[Unknown, Column]) -> dict[str, list[float]]:
    """Of parameters of one effect that no slope tells of: as scans and tracks are drawn anew.

    At jumps of the likelihood draws hardly scatter: there it must not have fallen too far, either.
    """
    effects, found = fitted.effects, {}
    lost, clusters = fitter.loss(fitted.pose, fitted.pose_sigma), (fitter.sample.frame, fitter.sample.track)
    held, drawn = dict[str, tuple[float, float]](), dict[str, Redrawn]()
    for unknown, column in columns.items():
        name, value = unknown.name, float(getattr(effects[place], unknown.name))
        pair = likely_interval(effects, place, unknown, column, lost, stray_weight(fitter, fitted))

        def losses(at: float, name: str = name) -> np.ndarray:
            moved = with_values(effects[place], {name: at})
            return fitter.losses((*effects[:place], moved, *effects[place + 1 :]), fitted.pose)

        apart = max((pair[1] - pair[0]) / 2, 1e-9)
        held[name] = pair
        drawn[name] = redrawn_interval(losses, value, apart, clusters, (unknown.low, unknown.high))
    wider = widening(effects, place, {name: pair for name, pair in held.items() if drawn[name].is_smooth}, lost)
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
    weight = sample.weight[sample.returned & sample.compared & (fitted.fit.matched < 0.5)]
    own = float((weight**2).sum() / weight.sum()) if len(weight) else 1.0
    return own / float(sample.weight.mean())
