"""What the estimated random effects have in common with a hypothesis.

Where random effects explain nearly all that a hypothesis changes, the beams cannot tell it from them, but the random
effects can: a delay makes the position errors of all scans proportional to the speed. They are a stratum of their own
(split-plot analysis: Nelder, Proc. R. Soc. A 283, 1965). Their variances were estimated without the hypothesis and
include what it explains; therefore the variance of each component is estimated again, together with the coefficient.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_FEWEST = 3  # random effects of a component from which a variance is estimated
_ROUNDS = 8
_NEGLIGIBLE = 1e-12  # scale
_FREEDOM = 3  # of the distribution of random effects: few objects have large errors


@dataclass(frozen=True, eq=False)
class RandomStratum:
    """Regression u = β·x + noise of random effects on a hypothesis.

    Attributes:
        u: (a,) estimated random effects.
        x: (a,) coefficients of the hypothesis in a regression on the random effects' columns.
        component: (a,) int variance component of each.
        components: number of variance components.
        clusters: two arrays (a,) int: cluster of each random effect by object track or map cell, and by part of a scan.
        counts: number of clusters of either kind.
    """

    u: np.ndarray
    x: np.ndarray
    component: np.ndarray
    components: int
    clusters: tuple[np.ndarray, np.ndarray]
    counts: tuple[int, int]

    def tables(self) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Score and information (clusters, 1) of β at 0, with variances estimated about the fitted β, by clustering."""
        beta, scale = self._fit(np.ones(len(self.u), bool))
        weight = self._weights(self.u - beta * self.x, scale) * self.x / scale[self.component] ** 2
        scores, informations = (
            tuple(
                np.bincount(cluster, values, count)[:, None]
                for cluster, count in zip(self.clusters, self.counts, strict=True)
            )
            for values in (weight * self.u, weight * self.x)
        )
        return (scores[0], scores[1]), (informations[0], informations[1])

    def gain(self, fold: np.ndarray, folds: int) -> np.ndarray:
        """Gain (folds,) in predictive log-likelihood of β on random effects that took no part in its fit.

        Args:
            fold: (a,) int fold of each random effect.
            folds: number of folds.
        """
        gains = np.zeros(folds)
        for number in range(folds):
            held, rest = fold == number, fold != number
            count = np.bincount(self.component[rest], minlength=self.components)
            held &= count[self.component] >= _FEWEST
            if held.any():
                beta, scale = self._fit(rest)
                none = self._scales(self.u, rest)
                for _ in range(_ROUNDS):
                    none = self._scales(self.u, rest, none)
                at = self.component[held]
                about_mean = _loglik(self.u[held] - beta * self.x[held], scale[at])
                gains[number] = about_mean - _loglik(self.u[held], none[at])
        return gains

    def _fit(self, used: np.ndarray) -> tuple[float, np.ndarray]:
        """Coefficient and scales (components,) by iteratively reweighted least squares on the random effects `used`.

        The likelihood has an optimum near the coefficient of every component alone; the iterations start at the best.
        """
        square = np.bincount(self.component[used], self.x[used] ** 2, self.components)
        product = np.bincount(self.component[used], (self.x * self.u)[used], self.components)
        alone = product[square > 0] / square[square > 0]

        def loglik(beta: float) -> float:
            residual = self.u - beta * self.x
            return _loglik(residual[used], self._scales(residual, used)[self.component[used]])

        beta = max((0.0, *map(float, alone)), key=loglik)
        scale = self._scales(self.u - beta * self.x, used)
        for _ in range(_ROUNDS):
            weight = self._weights(self.u - beta * self.x, scale) * self.x / scale[self.component] ** 2
            weight = np.where(used, weight, 0.0)
            beta = float(weight @ self.u) / max(float(weight @ self.x), 1e-300)
            scale = self._scales(self.u - beta * self.x, used, scale)
        return beta, scale

    def _weights(self, residual: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Weights (a,) of residuals with a Student-t distribution."""
        return (_FREEDOM + 1) / (_FREEDOM + (residual / scale[self.component]) ** 2)

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
    return -float(np.sum((_FREEDOM + 1) / 2 * np.log1p((residual / scale) ** 2 / _FREEDOM) + np.log(scale)))
