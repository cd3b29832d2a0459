"""Curves of selected dependences: what an unknown effect is made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cosim.discrepancy.dictionary.covariates import SampleCovariate
from cosim.discrepancy.dictionary.groups import Group, family_of
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.dictionary.objects import AXES, PLACES
from cosim.discrepancy.inference.dependence import SPURIOUS, Dependence
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.score import Column, Quantity, SparseMatrix, ridged, stacked
from cosim.discrepancy.selection.refit import Term, rebuilt
from cosim.discrepancy.unknown.curve import Curve


def curve_of(linearisation: Linearisation, term: Term, sectors: int) -> Curve | None:
    """The curve of a selected term; None for phases that differ from scan to scan, which no formula predicts.

    Also None for a dependence of which no value has a standard error, because its fit uses no information.

    Args:
        linearisation: about the model with the term.
        term: a dependence or a shared error.
        sectors: parts of a scan that are clusters.
    """
    group = term.group
    if group.is_shared:
        return _shared_curve(linearisation, term)
    if not group.is_clustered_by_scan:
        return None
    dependence = next(one for one in linearisation.fitted.dependences if one.basis is group.basis)
    y, sigma = dependence.coefficients, standard_errors(linearisation, dependence, sectors)
    if not np.any(np.isfinite(y) & np.isfinite(sigma)):
        return None
    if group.channel == "drop":
        y = np.maximum(y, -1.0)  # a laser that never returns; the likelihood is flat below
    if group.frequency_hz:
        start = float(linearisation.sample.scan_values["time_s"].min())
        return Curve(
            group.channel, ("time",), ("s",), (("cosine", "sine"),), y, sigma,
            frequency_hz=group.frequency_hz, start_s=start, p_value=term.p_value,
        )  # fmt: skip
    if group.covariates[-1] in ("object_size", "object_place"):
        kind = group.name.removeprefix("range by ").rsplit(" ", 1)[0]
        axes = AXES if group.covariates[-1] == "object_size" else PLACES
        return Curve(
            "range", ("kind", group.covariates[-1]), ("", "m"), ((kind,), axes), y[None], sigma[None],
            p_value=term.p_value,
        )  # fmt: skip
    return _binned_curve(group, y, sigma, term.p_value)


def rest_of_curve(
    linearisation: Linearisation, term: Term, covariates: Mapping[str, SampleCovariate], name: str, sectors: int
) -> Curve | None:
    """What the data still differ by from the fitted formula of a term, by bin: one Gauss–Newton step about it.

    The formula plus this rest is the curve next to everything else that is fitted (partial residuals: Larsen and
    McCleary, Technometrics 1972). None for terms without bins and for shares of spurious returns.

    Args:
        linearisation: about the final model.
        term: of the formula.
        covariates: of the sample, by name.
        name: of the formula's effect.
        sectors: parts of a scan that are clusters.
    """
    group, fitted = rebuilt(linearisation, term.group, covariates), linearisation.fitted
    if group is None or group.covariate is None or group.basis is None or group.channel in SPURIOUS:
        return None
    others = tuple(
        column
        for parameter, column in zip(fitted.free, fitted.columns, strict=False)
        if fitted.effects[parameter.effect].name != name
    )
    step, sigma = _step(linearisation, group.columns, others, group.channel, sectors)
    if group.channel == "drop":
        sigma = _of_probabilities(linearisation, Dependence(group.name, group.channel, group.basis, step), sigma)
    return _binned_curve(group, step, sigma, term.p_value)


def standard_errors(linearisation: Linearisation, dependence: Dependence, sectors: int) -> np.ndarray:
    """Cluster-robust standard errors (k,) of coefficients, everything else fitted eliminated.

    Shares of spurious returns: of Poisson counts.
    """
    sample, fitted = linearisation.sample, linearisation.fitted
    if dependence.channel in SPURIOUS:
        share = sample.share * sample.compared * sample.first
        beams, weighted = dependence.basis.T @ share, dependence.basis.T @ share**2
        event = weighted / np.maximum(beams, 1e-9)
        return np.sqrt(np.maximum(dependence.coefficients, 1 / np.maximum(beams, 1.0)) * event / np.maximum(beams, 1.0))
    index = next(row for row, one in enumerate(fitted.dependences) if one.basis is dependence.basis)
    at = len(fitted.columns) - len(fitted.dependences) + index
    others = tuple(column for row, column in enumerate(fitted.columns) if row != at)
    columns = stacked([fitted.columns[at]], linearisation.evidence.score, len(sample))
    _, sigma = _step(linearisation, columns, others, dependence.channel, sectors)
    return _of_probabilities(linearisation, dependence, sigma) if dependence.channel == "drop" else sigma


def _step(
    linearisation: Linearisation,
    columns: dict[Quantity, SparseMatrix],
    others: Sequence[Column],
    channel: str,
    sectors: int,
) -> tuple[np.ndarray, np.ndarray]:
    """One Gauss–Newton step (k,) of columns next to other ones, and its cluster-robust standard errors (k,)."""
    mixed = LinearModel.of(
        linearisation.fitter.random, others, linearisation.evidence, linearisation.fitted.prediction,
        linearisation.fitted.estimate,
    )  # fmt: skip
    found = replace(linearisation, mixed=mixed).projector(sectors, family_of(channel)).project(columns)
    inverse = np.linalg.pinv(ridged(found.information, 1e-6), hermitian=True)
    variances = [np.diag(inverse)]
    variances += [np.einsum("ij,jk,ik->i", inverse, table.T @ table, inverse) for table in found.tables]
    sigma = np.sqrt(np.maximum(np.max(variances, axis=0), 0))
    return inverse @ found.tables[0].sum(0), np.where(np.diag(found.information) > 0, sigma, np.inf)


def _of_probabilities(linearisation: Linearisation, dependence: Dependence, sigma: np.ndarray) -> np.ndarray:
    """Standard errors (k,) of relative changes of a probability, no less than binomial ones.

    Where a laser is dead, the likelihood is flat beyond its bound and its curvature gives no error.
    """
    sample, seen = linearisation.sample, linearisation.fitted.bare.seen
    share = sample.share * sample.compared * sample.first * (seen > 0)
    beams = np.maximum(dependence.basis.T @ share, 1.0)
    before = np.clip((dependence.basis.T @ (share * seen)) / beams, 1e-3, 1.0)
    after = np.clip(before * (1 + dependence.coefficients), 1 / beams, 1 - 1 / beams)
    binomial = np.sqrt(np.maximum(after * (1 - after), 0) / beams) / before
    return np.where(np.isfinite(sigma), np.maximum(sigma, binomial), binomial)


def _binned_curve(group: Group, y: np.ndarray, sigma: np.ndarray, p_value: float) -> Curve | None:
    covariate, kept = group.covariate, group.kept
    if covariate is None or kept is None:
        return None
    if len(covariate.parts) < 2:
        axis, unit = _axis(covariate, kept), covariate.unit
        return Curve(group.channel, (covariate.name,), (unit,), (axis,), y, sigma, (covariate.period,), p_value=p_value)
    first, second = covariate.parts
    shape = len(first), len(second)
    table, errors = np.full(shape, np.nan), np.full(shape, np.inf)
    table.flat[kept], errors.flat[kept] = y, sigma
    whole = [_axis(part, np.arange(len(part))) for part in (first, second)]
    return Curve(
        group.channel,
        (first.name, second.name),
        (first.unit, second.unit),
        (whole[0], whole[1]),
        table,
        errors,
        (first.period, second.period),
        p_value=p_value,
    )


def _axis(covariate: SampleCovariate, kept: np.ndarray) -> np.ndarray | tuple[str, ...]:
    if covariate.labels:
        return tuple(covariate.labels[row] for row in kept)
    return covariate.centres[kept]


def _shared_curve(linearisation: Linearisation, term: Term) -> Curve:
    """Standard deviation of a shared error, from the score of its variance."""
    group = term.group
    score, information = group.direct or (np.zeros(1), np.ones(1))
    known = max(float(information.sum()), 1e-300)
    variance = max(float(score.sum()) / known, 0.0)
    error = 1 / np.sqrt(known) * max(np.sqrt(float(linearisation.sample.share.max())), 1.0)
    size = np.sqrt(variance)
    return Curve(
        group.channel, group.covariates, ("",), ((group.covariates[0],),), np.array([size]),
        np.array([error / max(2 * size, 1e-9)]), p_value=term.p_value,
    )  # fmt: skip
