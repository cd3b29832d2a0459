"""How sure fitted parameters are: intervals that know that returns share errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse, stats

from cosim.discrepancy.fitting import Fitted, Fitter
from cosim.discrepancy.hard_limits import is_flat, is_searched, likely_interval, widened
from cosim.discrepancy.system import Normal

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
    stray_weight = _stray_weight(fitter, fitted)
    smooth: dict[int, dict[str, tuple[float, float]]] = {}
    lost = fitter.loss(fitted.pose, fitted.pose_sigma)
    for one, column in zip(fitted.free, fitted.columns, strict=True):
        part = widths[at : at + one.unknown.rings]
        at += one.unknown.rings
        effect = fitted.effects[one.effect]
        value = np.asarray(getattr(effect, one.unknown.name), float)
        if is_searched(effect, one.unknown, column):
            pair = np.array(likely_interval(fitted.effects, one.effect, one.unknown, column, lost, stray_weight))
            if not is_flat(one.unknown, column):
                smooth.setdefault(one.effect, {})[one.unknown.name] = (float(pair[0]), float(pair[1]))
        else:
            pair = np.stack([value - part, value + part], -1) if value.ndim else value + np.array([-part[0], part[0]])
        found.setdefault(effect.name, {})[one.unknown.name] = pair.tolist()
    for place, pairs in smooth.items():
        wide = widened(fitted.effects, place, pairs, lost)
        found[fitted.effects[place].name].update({name: list(pair) for name, pair in wide.items()})
    return found


def _stray_weight(fitter: Fitter, fitted: Fitted) -> float:
    """What a return from nowhere weighs on average in a sample whose beams weigh one."""
    sample = fitter.sample
    weight = sample.weight[sample.returned & sample.compared & (fitted.fit.matched < 0.5)]
    own = float((weight**2).sum() / weight.sum()) if len(weight) else 1.0
    return own / float(sample.weight.mean())
