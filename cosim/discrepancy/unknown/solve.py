"""Shapes of dependences that a screen has found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse, stats

from cosim.discrepancy.groups.dependences import OF_SCANS, Covariate, binned_group, covariates, over_a_turn, scale
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.score import Evidence, Quantity, SparseMatrix
from cosim.discrepancy.inference.score_test import Group
from cosim.discrepancy.sampling.sample import Prediction
from cosim.discrepancy.unknown.shape import Factor, Shape, best_formula


def shape_of(fitter: Fitter, fitted: Fitted, group: Group, p_value: float) -> Shape | None:
    """The shape of a dependence; None where it cannot be told.

    Args:
        fitter, fitted: the model that it is beside.
        group: what was found to be off.
        p_value: of it.
    """
    channel = next(iter(group.columns), None)
    if channel is None:
        return None
    firings = float(group.label) if group.covariates == ("phase",) else 0.0
    return _over(fitter, fitted, channel, group.covariates, firings, p_value)


def drawn_anew(fitter: Fitter, fitted: Fitted, shape: Shape) -> Shape | None:
    """A shape as it is beside another model than that which it was first drawn beside.

    Args:
        fitter, fitted: that model, without the shape.
        shape: as it was drawn.
    """
    over = ("scan",) if shape.covariate in OF_SCANS else shape.covariates
    return _over(fitter, fitted, shape.channel, over, shape.period, shape.p_value)


def _over(
    fitter: Fitter, fitted: Fitted, channel: Quantity, names: tuple[str, ...], firings: float, p_value: float
) -> Shape | None:
    if names == ("scan",):
        return _over_scans(fitter, fitted, channel, p_value)
    if names == ("phase",):
        return _of_phase(fitter, fitted, channel, firings, p_value)
    found = {one.name: one for one in covariates(fitter.sample, fitted.prediction, fitter.settings.shapes.bins)}
    if any(name not in found for name in names):
        return None
    if len(names) == 2:
        return _of_pair(fitter, fitted, channel, [found[name] for name in names], p_value)
    return _of_one(fitter, fitted, channel, found[names[0]], p_value)


def _of_one(fitter: Fitter, fitted: Fitted, channel: Quantity, covariate: Covariate, p_value: float) -> Shape | None:
    fewest = fitter.settings.screen.fewest_in_bin // 2
    group = binned_group(fitted, channel, covariate, fewest)
    if group is None:
        return None
    y, covariance = _solved(fitter, fitted, channel, group.columns[channel])
    used = (covariate.bin >= 0) & (fitted.evidence.information[channel] > 0)
    count = np.bincount(covariate.bin[used], minlength=len(covariate.centres))
    kept = np.flatnonzero(count >= fewest)
    sigma, x = np.sqrt(np.maximum(np.diag(covariance), 0)), covariate.centres[kept]
    names = tuple(covariate.names[i] for i in kept) if covariate.names else ()
    formula = None if names else best_formula(x, y, sigma, covariate.period, fitter.settings.shapes)
    return Shape(channel, covariate.name, covariate.unit, x, y, sigma, formula, names, p_value=p_value)


def _of_pair(fitter: Fitter, fitted: Fitted, channel: Quantity, pair: list[Covariate], p_value: float) -> Shape | None:
    """The product of two shapes that is nearest to a table over both (its first singular pair)."""
    by = fitter.settings.shapes
    one, other = (covariate.binned(by.pair_bins) for covariate in pair)
    shape = len(one.centres), len(other.centres)
    cell = np.where((one.bin >= 0) & (other.bin >= 0), one.bin * shape[1] + other.bin, -1)
    used = np.flatnonzero((cell >= 0) & (fitted.evidence.information[channel] > 0))
    count = np.bincount(cell[used], minlength=shape[0] * shape[1])
    kept = np.flatnonzero(count >= by.fewest)
    if len(kept) < 4:
        return None
    place = np.full(len(count), -1)
    place[kept] = np.arange(len(kept))
    used = used[place[cell[used]] >= 0]
    values = scale(fitted, channel)[used]
    columns = sparse.csr_matrix((values, (used, place[cell[used]])), (len(cell), len(kept)))
    y, covariance = _solved(fitter, fitted, channel, columns)
    table, weight = np.zeros(shape), np.zeros(shape)
    table.flat[kept] = y
    weight.flat[kept] = 1 / np.maximum(np.diag(covariance), 1e-12)
    first, second = np.ones(shape[0]), np.ones(shape[1])
    for _ in range(30):  # alternating least squares, weighted, with gaps
        second = (weight * table * first[:, None]).sum(0) / np.maximum((weight * first[:, None] ** 2).sum(0), 1e-12)
        second = second / max(float(np.abs(second).max()), 1e-12)
        first = (weight * table * second).sum(1) / np.maximum((weight * second**2).sum(1), 1e-12)
    sigma = 1 / np.sqrt(np.maximum((weight * second**2).sum(1), 1e-12))
    of_second = 1 / np.sqrt(np.maximum((weight * first[:, None] ** 2).sum(0), 1e-12))
    formula = best_formula(one.centres, first, sigma, one.period, by)
    formula_of_second = best_formula(other.centres, second, of_second, other.period, by)
    factor = Factor(other.name, other.unit, formula_of_second, other.centres, second)
    return Shape(channel, one.name, one.unit, one.centres, first, sigma, formula, factor=factor, p_value=p_value)


def _over_scans(fitter: Fitter, fitted: Fitted, channel: Quantity, p_value: float) -> Shape | None:
    """A level for each scan; told by a covariate of scans only where that explains more than chance would."""
    sample, by = fitter.sample, fitter.settings.shapes
    rows, scans = np.arange(len(sample)), len(sample.names)
    columns = sparse.csr_matrix((scale(fitted, channel), (rows, sample.frame)), (len(rows), scans))
    y, covariance = _solved(fitter, fitted, channel, columns)
    sigma, time_s = np.sqrt(np.maximum(np.diag(covariance), 0)), sample.scan_values["time_s"]
    best: tuple[float, Shape] | None = None
    for covariate in covariates(sample, fitted.prediction, by.bins):
        if covariate.name not in OF_SCANS:
            continue
        first = np.array([np.flatnonzero(sample.frame == scan)[0] for scan in range(scans)])
        x = covariate.values[first]
        order = np.argsort(x)
        formula = best_formula(x[order], y[order], sigma[order], by=by)
        count = len(formula.parameters)
        freedom = scans - count - 1
        if freedom < 3 or formula.r2 <= 0:
            continue
        chance = float(stats.f.sf(formula.r2 / max(1 - formula.r2, 1e-9) * freedom / count, count, freedom))
        if chance * by.formulas < by.sure and (best is None or chance < best[0]):
            told = x[order], y[order], sigma[order]
            best = chance, Shape(channel, covariate.name, covariate.unit, *told, formula, p_value=p_value)
    if best is not None:
        return best[1].with_aliases(by.regular) if best[1].covariate == "frame_time" else best[1]
    names = tuple(f"{value:.6f}" for value in time_s)
    return Shape(channel, "scan", "s", time_s, y, sigma, None, names, p_value=p_value)


def _of_phase(fitter: Fitter, fitted: Fitted, channel: Quantity, firings: float, p_value: float) -> Shape | None:
    """A shape over the phase, from −π to π, of a period of firings."""
    phase = np.mod(fitter.sample.firing, firings) / firings * 2 * np.pi - np.pi
    covariate = over_a_turn("phase", phase, fitter.settings.shapes.phase_bins)
    found = _of_one(fitter, fitted, channel, covariate, p_value)
    return None if found is None else replace(found, period=firings)


def _solved(fitter: Fitter, fitted: Fitted, channel: Quantity, columns: SparseMatrix) -> tuple[np.ndarray, np.ndarray]:
    """Values of a shape and their covariance, random effects eliminated; one step falls short of strong shapes."""
    size, by = columns.shape[1], fitter.settings.shapes
    y, evidence, covariance = np.zeros(size), fitted.evidence, np.zeros((size, size))
    for _ in range(by.steps):
        model = LinearModel.of(fitter.random, (), evidence, fitted.prediction, fitted.estimate)
        model = replace(model, x={channel: columns})
        covariance = np.linalg.pinv(model.fixed_information, hermitian=True)
        step, _ = model.step(fitted.estimate)
        y = y + step
        if np.all(np.abs(step) < by.settled * np.sqrt(np.maximum(np.diag(covariance), 0)) + 1e-12):
            break
        changed = _shaped(fitted.prediction, channel, np.asarray(columns @ y), 1 - by.most_lost)
        evidence = Evidence.of(fitter.sample, fitter.residuals(changed, fitted.estimate))
    return y, covariance


def _shaped(before: Prediction, channel: Quantity, change: np.ndarray, least: float) -> Prediction:
    """A prediction with a change (n,) on top, in the unit of its channel; a `least` share of it stays."""
    if channel == "range":
        return replace(before, range_m=before.range_m + change)
    if channel == "drop":
        seen = np.clip(before.seen + change, least * before.seen, 1)
        return replace(before, seen=seen, silent=np.clip(before.silent + before.seen - seen, 0, 1))
    return replace(before, intensity=np.maximum(before.intensity + change, least * before.intensity))
