"""Significance of a fitted term about its own fit.

A strong effect on few clusters makes all of their scores large and of one sign, so that random signs of these scores
reach its statistic often. About the fit the scores hold nothing but noise: their signs give the reference distribution.
The statistic is the likelihood ratio, not Wald's, which grows without limit where the likelihood is flat: a beam that
always returns cannot return more often, whatever its coefficient (Hauck and Donner, J. Am. Stat. Assoc. 1977).
The score of each cluster is taken about the fit to the other clusters, because its own influence makes it smaller (the
jackknife CR3: Cameron and Miller, J. Hum. Resour. 2015).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.discrepancy.candidates import amplitudes, switches
from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.linearisation import linearise
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.score import ridged, stacked
from cosim.discrepancy.selection.calibration import random_signs, surprise
from cosim.discrepancy.selection.refit import FittedModel
from cosim.discrepancy.settings import Selection

_RIDGE = 1e-3  # share of the information that a prior at 0 has


def p_about_fit(
    model: FittedModel, group: Group, gain: float, tested: int, settings: Selection, rng: np.random.Generator
) -> float:
    """Family-wise p-value of the term that was fitted last, corrected for the number of hypotheses (Bonferroni).

    Args:
        model: with the term among its parameters.
        group: of the term.
        gain: marginal log-likelihood that the term gained.
        tested: number of hypotheses.
        settings: numeric choices.
        rng: for the signs.
    """
    linearisation = linearise(model.fitter, model.fitted, model.frames)
    fitted, columns = model.fitted, linearisation.fitted.columns
    rows, size = _parameters(model, group)
    if not rows:
        return 1.0
    others = tuple(column for row, column in enumerate(columns) if row not in rows)
    evidence = linearisation.evidence
    mixed = LinearModel.of(model.fitter.random, others, evidence, fitted.prediction, fitted.estimate)
    own = stacked([columns[row] for row in rows], evidence.score, len(linearisation.sample))
    found = replace(linearisation, mixed=mixed).projector(settings.sectors, group.family).project(own)
    precision = np.linalg.pinv(ridged(found.information, 1e-2), hermitian=True)
    observed, worst = 2 * gain, 0.0
    for number, table in enumerate(found.tables):
        if number == 1 and not group.is_clustered_by_scan:
            continue
        table = _about_others(table, found.cluster_information[number], np.diag(found.information) * size)
        used = table[np.abs(table).sum(1) > 0]
        drawn = random_signs(len(used), settings.confirm_draws, rng)[1:] @ used
        values = np.append(observed, np.einsum("dk,kl,dl->d", drawn, precision, drawn))
        statistic = np.cbrt(np.maximum(values, 0))
        worst = max(worst, float(np.exp(-surprise(statistic[:, None])[0, 0])))
    return min(worst * tested, 1.0)


def _about_others(table: np.ndarray, information: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """Scores (clusters, k) about coefficients that are fitted without the cluster, column by column.

    Args:
        table: scores about the fit.
        information: (clusters, k) of each cluster.
        pull: (k,) information times the coefficient: where a cluster is the only one, its score without a fit.
    """
    leverage = information / np.maximum(information.sum(0), 1e-300)
    rest = 1 - leverage
    without = (rest * pull - table) / (rest + _RIDGE)  # information times the coefficient of the others
    return table + leverage * (pull - without)


def _parameters(model: FittedModel, group: Group) -> tuple[list[int], np.ndarray]:
    """Rows of the term among the columns of the fit, and the distance (k,) of its parameters from doing nothing."""
    fitted = model.fitted
    if not group.is_effect:
        return [len(fitted.columns) - 1], fitted.dependences[-1].coefficients
    kind = type(next(effect for effect in fitted.effects if effect.name == group.effect_name))
    names = amplitudes(kind) or switches(kind)
    rows, size = [], [np.zeros(0)]
    for row, free in enumerate(fitted.free):
        effect = fitted.effects[free.effect]
        if effect.name == group.effect_name and free.unknown.name in names:
            value = np.asarray(getattr(effect, free.unknown.name), float)
            rows.append(row)
            size.append(np.atleast_1d(value - np.asarray((kind.neutral or {})[free.unknown.name], float)))
    return rows, np.concatenate(size)
