"""Curves of selected dependences: what an unknown effect is made from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.discrepancy.dictionary.covariates import SampleCovariate
from cosim.discrepancy.dictionary.groups import Group, family_of
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.dictionary.objects import AXES, PLACES
from cosim.discrepancy.inference.dependence import SPURIOUS, Dependence
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.score import ridged, stacked
from cosim.discrepancy.selection.refit import Term
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
    own = fitted.columns[at]
    others = tuple(column for row, column in enumerate(fitted.columns) if row != at)
    mixed = LinearModel.of(
        linearisation.fitter.random, others, linearisation.evidence, fitted.prediction, fitted.estimate
    )
    columns = stacked([own], linearisation.evidence.score, len(sample))
    projector = replace(linearisation, mixed=mixed).projector(sectors, family_of(dependence.channel))
    found = projector.project(columns)
    inverse = np.linalg.pinv(ridged(found.information, 1e-6), hermitian=True)
    variances = [np.diag(inverse)]
    variances += [np.einsum("ij,jk,ik->i", inverse, table.T @ table, inverse) for table in found.tables]
    sigma = np.sqrt(np.maximum(np.max(variances, axis=0), 0))
    sigma = np.where(np.diag(found.information) > 0, sigma, np.inf)
    return _of_probabilities(linearisation, dependence, sigma) if dependence.channel == "drop" else sigma


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
