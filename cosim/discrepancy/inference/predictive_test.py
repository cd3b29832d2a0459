"""Significance of a regression of random effects, from predictions of one part of the drive by the others.

A hypothesis about errors of poses concerns few scans, so that random signs show little. The likelihood says more: each
part of the drive is predicted from the parts before it, with and without the hypothesis. If nothing is missing, the
ratio of the predictive likelihood to the largest one without the hypothesis exceeds 1/α with a probability of at most α
(universal inference: Wasserman, Ramdas and Balakrishnan, PNAS 117, 2020). The errors of successive scans may depend on
each other: two quantities that drift always correlate (Granger and Newbold, J. Econometrics 2, 1974). Each
component therefore is an autoregression of first order, estimated together with the coefficients (Cochrane and Orcutt,
J. Am. Stat. Assoc. 44, 1949).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FREEDOM = 3
"""Degrees of freedom of the distribution of random effects: few objects have large errors."""
_PARTS = 4  # of the drive that are predicted one after another
_FEWEST = 3  # random effects of a component from which its variance is estimated
_ROUNDS = 8
_RIDGE = 1e-3  # share of the information
_NEGLIGIBLE = 1e-12  # scale
_LARGEST_AUTOCORRELATION = 0.98  # of successive errors


@dataclass(frozen=True, eq=False)
class _Fit:
    """Coefficients (k,), and autocorrelations and scales (components,) of the errors."""

    beta: np.ndarray
    autocorrelation: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True, eq=False)
class _Regression:
    """u = Xβ + e with errors e of components, each an autoregression with innovations of a Student-t distribution.

    Attributes:
        u, x: (a,) and (a, k).
        component: (a,) int.
        before: (a,) int row of the preceding error of the same component; −1 for the first one.
        one_sided: whether only positive β make sense.
    """

    u: np.ndarray
    x: np.ndarray
    component: np.ndarray
    before: np.ndarray
    one_sided: bool

    def without(self) -> _Regression:
        """The same errors without the hypothesis."""
        return _Regression(self.u, self.x[:, :0], self.component, self.before, False)

    def fitted(self, used: np.ndarray) -> _Fit:
        """The most likely fit to the rows `used` (a,); started from the coefficients of each component."""
        count = int(self.component.max()) + 1
        starts = [np.zeros(self.x.shape[1])]
        for component in np.unique(self.component[used]) if self.x.shape[1] else ():
            starts.append(self._coefficients(np.where(used & (self.component == component), 1.0, 0.0), np.zeros(count)))
        fits = [self._improved(used, start, count) for start in starts]
        return max(fits, key=lambda fit: self.loglik(used, fit))

    def loglik(self, rows: np.ndarray, fit: _Fit) -> float:
        """Log-likelihood of the rows (a,) given the errors before them, up to a constant for each."""
        scale = fit.scale[self.component]
        z = self._innovations(self.u - self.x @ fit.beta, fit.autocorrelation) / scale
        return -float(np.sum(((FREEDOM + 1) / 2 * np.log1p(z**2 / FREEDOM) + np.log(scale))[rows]))

    def _improved(self, used: np.ndarray, beta: np.ndarray, count: int) -> _Fit:
        at = self.component[used]
        counts = np.maximum(np.bincount(at, minlength=count), 1)
        autocorrelation, scale = np.zeros(count), np.ones(count)
        for number in range(_ROUNDS):
            error = self.u - self.x @ beta
            own = self._innovations(error, autocorrelation)
            if number == 0:
                scale = np.bincount(at, np.abs(own[used]), count) / counts
            weight = (FREEDOM + 1) / (FREEDOM + (own / np.maximum(scale, _NEGLIGIBLE)[self.component]) ** 2)
            scale = np.maximum(np.sqrt(np.bincount(at, (weight * own**2)[used], count) / counts), _NEGLIGIBLE)
            rows = np.where(used, weight, 0.0)
            autocorrelation = self._autocorrelation(error, rows, count)
            beta = self._coefficients(rows / scale[self.component] ** 2, autocorrelation)
        return _Fit(beta, autocorrelation, scale)

    def _innovations(self, values: np.ndarray, autocorrelation: np.ndarray) -> np.ndarray:
        """Values (a, …) less what the preceding ones predict."""
        known = (self.before >= 0) * autocorrelation[self.component]
        return values - (known * values[self.before].T).T

    def _autocorrelation(self, error: np.ndarray, weight: np.ndarray, count: int) -> np.ndarray:
        """Autocorrelation (components,) of errors (a,)."""
        weight = weight * (self.before >= 0)
        past = error[self.before]
        square = np.bincount(self.component, weight * past**2, count)
        product = np.bincount(self.component, weight * past * error, count)
        return np.clip(product / np.maximum(square, 1e-300), 0.0, _LARGEST_AUTOCORRELATION)

    def _coefficients(self, weight: np.ndarray, autocorrelation: np.ndarray) -> np.ndarray:
        """Coefficients (k,) of a weighted regression; 0 where nothing informs about them."""
        x, u = self._innovations(self.x, autocorrelation), self._innovations(self.u, autocorrelation)
        weighted = weight[:, None] * x
        information = weighted.T @ x
        diagonal = np.diag(information)
        beta = np.linalg.solve(information + np.diag(np.where(diagonal > 0, _RIDGE * diagonal, 1.0)), weighted.T @ u)
        return np.maximum(beta, 0) if self.one_sided else beta


def p_of_predictions(
    u: np.ndarray, x: np.ndarray, component: np.ndarray, cluster: np.ndarray, one_sided: bool = False
) -> float:
    """Bound on the p-value of a regression of random effects.

    Predictions go forwards and backwards; the mean of both likelihood ratios is the test statistic.

    Args:
        u: (a,) estimated random effects.
        x: (a, k) coefficients of the hypothesis' columns.
        component: (a,) int variance component of each.
        cluster: (a,) int scan, object or square of the map, in their order.
        one_sided: whether only positive coefficients make sense.
    """
    order = np.lexsort((cluster, component))
    component, part = component[order], _parts(component, cluster)[order]
    before = np.arange(len(u)) - 1
    before[np.flatnonzero(np.diff(component, prepend=-1))] = -1
    after = np.arange(len(u)) + 1
    after[np.flatnonzero(np.diff(component, append=component[-1:] + 1))] = -1
    forwards, backwards = (
        _log_ratio(_Regression(u[order], x[order], component, neighbour, one_sided), each)
        for neighbour, each in ((before, part), (after, _PARTS - 1 - part))
    )
    return float(np.exp(min(np.log(2) - np.logaddexp(forwards, backwards), 0.0)))


def _parts(component: np.ndarray, cluster: np.ndarray) -> np.ndarray:
    """Part (a,) int of the drive: clusters of each kind in their order, in equal numbers."""
    kind = np.full(int(cluster.max()) + 1, int(component.max()) + 1)  # lowest component: the same for one kind
    np.minimum.at(kind, cluster, component)
    part = np.zeros(len(kind), int)
    for each in np.unique(kind[cluster]):
        own = np.flatnonzero(kind == each)
        part[own] = np.arange(len(own)) * _PARTS // len(own)
    return part[cluster]


def _log_ratio(regression: _Regression, part: np.ndarray) -> float:
    """Logarithm of the predictive likelihood of all parts but the first over the largest without the hypothesis."""
    ratio, tested = 0.0, np.zeros(len(part), bool)
    for number in range(1, _PARTS):
        known = part < number
        counts = np.bincount(regression.component[known], minlength=int(regression.component.max()) + 1)
        held = (part == number) & (counts[regression.component] >= _FEWEST)
        if held.any():
            ratio += regression.loglik(held, regression.fitted(known))
            tested |= held
    none = regression.without()
    return ratio - none.loglik(tested, none.fitted(tested)) if tested.any() else 0.0
