"""Gain of dependences of the probability of a return, from the returns and losses themselves.

The second derivative of a binomial likelihood says nothing about a beam that nearly always returns: it cannot return
more often, but may well be lost. Gains are therefore computed from counts of returns and losses, by column and by class
of the predicted probability, instead of a parabola about it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.linearisation import Linearisation

_CLASSES = 12  # of the predicted probability, equally wide in log-odds
_RISES = np.geomspace(0.002, 8.0, 24)  # relative changes of the probability that are tried,
_FALLS = -np.geomspace(0.002, 0.98, 24)  # upwards and downwards


@dataclass(frozen=True, eq=False)
class ReturnCounts:
    """Returns and losses by fold, column and class.

    Attributes:
        probability: (c,) predicted probability of each class.
        sign: (c,) sign of the column's values in each class.
        returned, lost: (folds, k, c) weighted numbers of beams.
        least: smallest probability of a return, and of a loss.
    """

    probability: np.ndarray
    sign: np.ndarray
    returned: np.ndarray
    lost: np.ndarray
    least: float

    def gain(self) -> np.ndarray:
        """Gain (folds,) in log-likelihood on each fold of the change (k,) that is the best for the other folds."""
        changes = np.concatenate([[0.0], _RISES, _FALLS])
        new = self.probability * (1 + changes[:, None] * self.sign)  # (changes, c)
        new = np.clip(new, self.least, 1 - self.least)
        of_return, of_loss = np.log(new / self.probability), np.log((1 - new) / (1 - self.probability))
        loglik = self.returned @ of_return.T + self.lost @ of_loss.T  # (folds, k, changes)
        rest = loglik.sum(0) - loglik
        best = rest.argmax(-1)
        return np.take_along_axis(loglik, best[..., None], -1)[..., 0].sum(1)


def count_returns(linearisation: Linearisation, group: Group, fold: np.ndarray, folds: int) -> ReturnCounts:
    """Count returns and losses of a dependence's beams.

    Values of the basis functions between 0 and ±1 count a beam in part.

    Args:
        linearisation: about a fit.
        group: dependence of the channel `drop`.
        fold: (n,) int fold of each beam.
        folds: number of folds.
    """
    assert group.basis is not None
    p, returned, trials = _trials(linearisation)
    least = float(linearisation.sample.settings.likelihood.lost_share)
    edges = np.linspace(special.logit(least), special.logit(1 - least), _CLASSES + 1)
    number = np.clip(np.searchsorted(edges, special.logit(p)) - 1, 0, _CLASSES - 1)
    probability = special.expit((edges[1:] + edges[:-1]) / 2)
    weighed = np.bincount(number, trials, _CLASSES)
    mean = np.bincount(number, trials * p, _CLASSES) / np.maximum(weighed, 1e-300)
    probability = np.where(weighed > 0, mean, probability)
    basis = group.basis.tocoo()
    row, size = basis.row, np.abs(basis.data)
    is_negative = (basis.data < 0).astype(int)
    at = ((fold[row] * group.size + basis.col) * 2 + is_negative) * _CLASSES + number[row]
    shape = (folds, group.size, 2 * _CLASSES)
    counts = [
        np.bincount(at, values[row] * size, int(np.prod(shape))).reshape(shape)
        for values in (returned, trials - returned)
    ]
    return ReturnCounts(np.tile(probability, 2), np.repeat([1.0, -1.0], _CLASSES), counts[0], counts[1], least)


def effect_gains(
    linearisation: Linearisation, derivative: np.ndarray, folds: list[np.ndarray], count: int
) -> list[np.ndarray]:
    """Gains (count,) by fold of an effect that changes nothing but the probability of a return, for each clustering.

    Args:
        linearisation: about a fit.
        derivative: (n,) of the probability with respect to the effect's amplitude.
        folds: for each clustering, (n,) int fold of each beam.
        count: number of folds.
    """
    p, returned, trials = _trials(linearisation)
    used = np.flatnonzero((trials > 0) & (derivative != 0))
    p, returned, lost = p[used], returned[used], (trials - returned)[used]
    least = linearisation.sample.settings.likelihood.lost_share
    relative = derivative[used] / p
    relative = relative / np.max(np.abs(relative), initial=1e-300)
    loglik = np.zeros((1 + len(_RISES) + len(_FALLS), len(used)))
    for row, change in enumerate((*_RISES, *_FALLS), start=1):
        new = np.clip(p * (1 + change * relative), least, 1 - least)
        loglik[row] = returned * np.log(new / p) + lost * np.log((1 - new) / (1 - p))
    gains = []
    for fold in folds:
        sums = np.stack([np.bincount(fold[used], values, count) for values in loglik])  # (changes, folds)
        best = (sums.sum(1, keepdims=True) - sums).argmax(0)
        gains.append(sums[best, np.arange(count)])
    return gains


def expected_losses(linearisation: Linearisation, group: Group) -> np.ndarray:
    """Expected number (k,) of losses among the beams of each column of a dependence."""
    assert group.basis is not None
    p, _, trials = _trials(linearisation)
    return abs(group.basis).T @ (trials * (1 - p))


def _trials(linearisation: Linearisation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Predicted probability of a return, weighted number of returns, and of returns and losses together (n,) each.

    Returns of other surfaces are neither; the probability is that of a return if there is none of these.
    """
    score, information = (
        values["drop"] for values in (linearisation.evidence.score, linearisation.evidence.information)
    )
    least = linearisation.sample.settings.likelihood.lost_share
    seen, silent = (
        np.clip(values, least, 1 - least) for values in (linearisation.adjusted.seen, linearisation.adjusted.silent)
    )
    p, trials = seen / (seen + silent), information * seen * silent
    return p, np.clip(score * seen * silent / (seen + silent) + p * trials, 0, trials), trials
