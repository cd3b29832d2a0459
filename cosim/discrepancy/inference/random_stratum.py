"""What the estimated random effects have in common with a hypothesis.

Where random effects explain nearly all that a hypothesis changes, the beams cannot distinguish the two, but the random
effects can: a delay makes the position errors of all scans proportional to the speed. They are a stratum of their own
(split-plot analysis: Nelder, Proc. R. Soc. A 283, 1965). Their variances were estimated without the hypothesis and
include what it explains; therefore the variance of each component is estimated again, together with the coefficient.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cosim.discrepancy.inference.predictive_test import FREEDOM, p_of_predictions

_FEWEST = 3  # random effects of a component from which a variance is estimated
_ROUNDS = 8
_ROUNDS_AGAIN = 3  # from the fit to all random effects
_RIDGE = 1e-3  # share of the information
_NEGLIGIBLE = 1e-12  # scale
_MOST = 0.8  # share of the information


@dataclass(frozen=True, eq=False)
class RandomStratum:
    """Regression u = Xβ + noise of random effects on the k columns of a hypothesis.

    Attributes:
        u: (a,) estimated random effects.
        x: (a, k) coefficients of the columns in a regression on the random effects' columns.
        component: (a,) int variance component of each.
        components: number of variance components.
        clusters: two arrays (a,) int: cluster of each random effect by object track or map cell, and by part of a scan.
        counts: number of clusters of either kind.
        one_sided: whether only positive β make sense.
    """

    u: np.ndarray
    x: np.ndarray
    component: np.ndarray
    components: int
    clusters: tuple[np.ndarray, np.ndarray]
    counts: tuple[int, int]
    one_sided: bool = False

    @cached_property
    def _best(self) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients (k,) and scales (components,) of all random effects.

        The likelihood has an optimum near the coefficients of each component; the iterations start at the best of them.
        """
        used, starts = np.ones(len(self.u), bool), [np.zeros(self.x.shape[1])]
        for component in np.unique(self.component):
            starts.append(self._regression(np.where(self.component == component, 1.0, 0.0)))

        def loglik(beta: np.ndarray) -> float:
            residual = self.u - self.x @ beta
            return _loglik(residual, self._scales(residual, used)[self.component])

        beta = max(starts, key=loglik)
        return self._fit(used, beta, self._scales(self.u - self.x @ beta, used), _ROUNDS)

    @cached_property
    def _scales_about_none(self) -> np.ndarray:
        """Scales (components,) of all random effects without β, by as many iterations as with it."""
        used = np.ones(len(self.u), bool)
        return self._rescaled(self.u, used, self._scales(self.u, used), _ROUNDS)

    @property
    def information(self) -> np.ndarray:
        """(k, k) information about β, with the scales of the components estimated about the fitted β."""
        return self.x.T @ (self._weight[:, None] * self.x)

    def tables(self) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Score and information (clusters, k) of β at 0, by clustering; scales as in `information`."""
        score = self._weight[:, None] * self.x * self.u[:, None]
        information = self._weight[:, None] * self.x**2
        (a, b), (c, d) = (
            [_summed(values, cluster, count) for cluster, count in zip(self.clusters, self.counts, strict=True)]
            for values in (score, information)
        )
        return (a, b), (c, d)

    def gain(self, fold: np.ndarray, folds: int) -> np.ndarray:
        """Gain (folds,) in predictive log-likelihood of β on random effects that took no part in its fit.

        Args:
            fold: (a,) int fold of each random effect.
            folds: number of folds.
        """
        gains, (best, scales), scales_of_none = np.zeros(folds), self._best, self._scales_about_none
        for number in range(folds):
            held, rest = fold == number, fold != number
            count = np.bincount(self.component[rest], minlength=self.components)
            held &= count[self.component] >= _FEWEST
            if held.any():
                beta, scale = self._fit(rest, best, scales, _ROUNDS_AGAIN)
                none = self._rescaled(self.u, rest, scales_of_none, _ROUNDS_AGAIN)
                at = self.component[held]
                about_mean = _loglik(self.u[held] - self.x[held] @ beta, scale[at])
                gains[number] = about_mean - _loglik(self.u[held], none[at])
        return gains

    def p_of_predictions(self) -> float:
        """Bound on the p-value, from predictions of one part of the drive by the others; see `predictive_test`.

        Only the components that have most of the information take part.
        """
        known = np.bincount(self.component, self._weight * (self.x**2).sum(1), self.components)
        order = np.argsort(-known)
        before = np.cumsum(known[order]) - known[order]
        concerned = order[(before < _MOST * known.sum()) & (known[order] > 0)]
        rows = np.flatnonzero(np.isin(self.component, concerned))
        if not len(rows):
            return 1.0
        number = np.unique(self.component[rows], return_inverse=True)[1]
        return p_of_predictions(self.u[rows], self.x[rows], number, self.clusters[0][rows], self.one_sided)

    @property
    def _weight(self) -> np.ndarray:
        """Weight (a,) of each random effect about the best fit."""
        beta, scale = self._best
        return self._weights(self.u - self.x @ beta, scale) / scale[self.component] ** 2

    def _fit(self, used: np.ndarray, beta: np.ndarray, scale: np.ndarray, rounds: int) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients and scales by iteratively reweighted least squares on the random effects `used`."""
        for _ in range(rounds):
            weight = self._weights(self.u - self.x @ beta, scale) / scale[self.component] ** 2
            beta = self._regression(np.where(used, weight, 0.0))
            scale = self._scales(self.u - self.x @ beta, used, scale)
        return beta, scale

    def _regression(self, weight: np.ndarray) -> np.ndarray:
        """Coefficients (k,) of a weighted regression; 0 where nothing informs about them."""
        weighted = weight[:, None] * self.x
        information = weighted.T @ self.x
        diagonal = np.diag(information)
        ridge = np.where(diagonal > 0, _RIDGE * diagonal, 1.0)
        beta = np.linalg.solve(information + np.diag(ridge), weighted.T @ self.u)
        return np.maximum(beta, 0) if self.one_sided else beta

    def _rescaled(self, residual: np.ndarray, used: np.ndarray, scale: np.ndarray, rounds: int) -> np.ndarray:
        for _ in range(rounds):
            scale = self._scales(residual, used, scale)
        return scale

    def _weights(self, residual: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Weights (a,) of residuals with a Student-t distribution."""
        return (FREEDOM + 1) / (FREEDOM + (residual / scale[self.component]) ** 2)

    def _scales(self, residual: np.ndarray, used: np.ndarray, scale: np.ndarray | None = None) -> np.ndarray:
        """Scales (components,) of residuals (a,): one step from `scale`, or from their mean absolute values."""
        at, size = self.component[used], np.abs(residual[used])
        count = np.maximum(np.bincount(at, minlength=self.components), 1)
        if scale is None:
            return np.maximum(np.bincount(at, size, self.components) / count, _NEGLIGIBLE)
        squares = np.bincount(at, self._weights(residual, scale)[used] * size**2, self.components)
        return np.maximum(np.sqrt(squares / count), _NEGLIGIBLE)


def _loglik(residual: np.ndarray, scale: np.ndarray) -> float:
    """Log-likelihood of residuals with a Student-t distribution, up to a constant for each."""
    return -float(np.sum((FREEDOM + 1) / 2 * np.log1p((residual / scale) ** 2 / FREEDOM) + np.log(scale)))


def _summed(values: np.ndarray, cluster: np.ndarray, count: int) -> np.ndarray:
    """Sums (count, k) of values (a, k) by cluster."""
    return np.stack([np.bincount(cluster, column, count) for column in values.T], 1)
