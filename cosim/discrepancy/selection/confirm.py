"""Significance of a fitted term, from the log-likelihood that each cluster gains.

A strong effect on few clusters makes all of their scores large and of one sign, so that random signs of these scores
reach its statistic often. The gains of the exact fits say more. Two tests of them are made:

- Each cluster gains its expected share of the total G, and a difference by the noise s of its score, βᵀs for a step β.
  With an information I, 2G = βᵀIβ, and the sum of the squared differences estimates βᵀJβ for the variance J of the
  scores by clusters. Divided by their ratio, the dispersion, 2G has about a χ² distribution (Varin, Reid and Firth,
  Stat. Sin. 2011, § 2.3; gains of single observations: Vuong, Econometrica 1989), or, as the dispersion is estimated,
  an F distribution.
- Without an effect, the gain of a cluster is as likely negative as positive: random signs of the gains reach their sum
  with at most the probability exp(Σ ln cosh(t·gain) − t·G) for any t (Chernoff bound). This holds however the strength
  of the effect differs between clusters.

A likelihood that jumps between neighbouring values of a parameter gains by chance, but not in all clusters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize, stats

from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.score import change
from cosim.discrepancy.selection.refit import FittedModel
from cosim.discrepancy.settings import Selection

_LOG_T = (-20.0, 20.0)  # interval of ln t, for gains of which the largest is 1
_ALONE = 1e-3  # least share of the information that the other clusters have


@dataclass(frozen=True, eq=False)
class _Gains:
    """Gains of n beams and m random effects.

    Attributes:
        of_beams, of_random: (n,), (m,) gain in log-likelihood.
        expected_of_beams, expected_of_random: what is expected of each, relative to the others.
    """

    of_beams: np.ndarray
    of_random: np.ndarray
    expected_of_beams: np.ndarray
    expected_of_random: np.ndarray

    def without_beams(self) -> _Gains:
        """The gains of the random effects."""
        return replace(
            self, of_beams=np.zeros_like(self.of_beams), expected_of_beams=np.zeros_like(self.expected_of_beams)
        )


def p_of_gain(
    before: FittedModel,
    after: FittedModel,
    group: Group,
    chance: float,
    settings: Selection,
    *,
    only_random: bool = False,
) -> float:
    """p-value of the gain in log-likelihood between two fits to the same sample; of both clusterings the larger one.

    Args:
        before, after: without and with a term.
        group: of the term.
        chance: gain that is expected by chance.
        settings: numeric choices.
        only_random: whether only random effects inform about the term: what beams gain is chance then.
    """
    fitter = after.fitter
    gains, gain = _gains(fitter, before.fitted, after.fitted), after.loglik - before.loglik
    if only_random:
        gains, gain = gains.without_beams(), float(gains.of_random.sum())
    parameters = max(_size(after.fitted) - _size(before.fitted), 1)
    clusters = fitter.random.clusters_of(group.family == "range", 1 if group.is_of_scan else settings.sectors)
    beams = (clusters.track, clusters.part)
    clusterings = list(zip(beams, clusters.of_random_effects(), clusters.counts, strict=True))
    worst = 0.0
    for of_beam, of_random, count in clusterings if group.is_clustered_by_scan else clusterings[:1]:
        gained = np.bincount(of_beam, gains.of_beams, count) + np.bincount(of_random, gains.of_random, count)
        expected = np.bincount(of_beam, gains.expected_of_beams, count)
        expected += np.bincount(of_random, gains.expected_of_random, count)
        worst = max(worst, p_of_clusters(gained, expected, gain, parameters, chance))
    return worst


def _size(fitted: Fitted) -> int:
    return sum(column.rings for column in fitted.columns)


def p_of_clusters(gained: np.ndarray, expected: np.ndarray, gain: float, parameters: int, chance: float) -> float:
    """p-value of a total gain, of which the clusters (clusters,) gained and were expected to gain parts.

    The share of each cluster is that of a fit to the others, because its own influence on the fit makes the difference
    smaller (the jackknife CR3: Cameron and Miller, J. Hum. Resour. 2015). The degrees of freedom of the dispersion are
    those of a sum of squares of normal variables with unequal variances (Satterthwaite, Biometrics 1946).

    Args:
        gained: by each cluster.
        expected: of each cluster, relative to the others.
        gain: total.
        parameters: number of them.
        chance: gain that is expected by chance.
    """
    share = expected / max(float(expected.sum()), 1e-300)
    square = ((gained - gained.sum() * share) / np.maximum(1 - share, _ALONE)) ** 2
    if gain <= 0 or not square.any():
        return 1.0
    freedom = max(3 * square.sum() ** 2 / (square**2).sum() - 2, 1.0)
    by_shares = float(stats.f.sf((2 * gain) ** 2 / square.sum() / parameters, parameters, freedom))
    return min(2 * min(by_shares, p_of_signs(gained, chance)), 1.0)


def p_of_signs(gained: np.ndarray, chance: float = 0.0) -> float:
    """Bound on the probability that random signs of gains (clusters,) reach their sum, less the gain `chance`."""
    total = float(gained.sum()) - chance
    if total <= 0:
        return 1.0
    size = np.abs(gained).max()
    unit, total = gained / size, total / size

    def log_bound(log_t: float) -> float:
        t = np.exp(log_t)
        return float(np.sum(np.logaddexp(t * unit, -t * unit) - np.log(2)) - t * total)

    found = optimize.minimize_scalar(log_bound, bounds=_LOG_T, method="bounded")
    return float(np.exp(min(log_bound(float(found.x)), 0.0)))  # pyright: ignore[reportAttributeAccessIssue]


def _gains(fitter: Fitter, before: Fitted, after: Fitted) -> _Gains:
    """Changes of the marginal log-likelihood, with the volume of each random effect as if it were the only one."""
    sample, random = fitter.sample, fitter.random
    predictions = [random.adjusted(fitted.prediction, fitted.estimate) for fitted in (before, after)]
    expected = np.zeros(len(sample))
    for name, difference in change(sample, *predictions).items():
        if name in after.evidence.information:
            expected += after.evidence.information[name] * difference**2
    least, reach_m = sample.settings.likelihood.least_spurious_share, sample.settings.likelihood.reach_m
    old, new = (least + one.spurious_per_m * reach_m + one.spurious_share for one in predictions)
    expected += sample.share * (new - old) ** 2 / np.maximum(old, new)
    beams = sample.share * (after.residuals.loglik - before.residuals.loglik)
    (old_density, _), (new_density, precision) = (_density_of_random(fitter, one) for one in (before, after))
    moved = after.estimate.u - before.estimate.u
    return _Gains(beams, new_density - old_density, expected, precision * moved**2)


def _density_of_random(fitter: Fitter, fitted: Fitted) -> tuple[np.ndarray, np.ndarray]:
    """Logarithm (m,) of the density of each random effect times its posterior volume, and its prior precision."""
    model = LinearModel.of(fitter.random, (), fitted.evidence, fitted.prediction, fitted.estimate)
    u, density, precision = fitted.estimate.u, np.zeros(fitter.random.size), np.zeros(fitter.random.size)
    information = model.information.diagonal()
    precision[model.used] = model.precision
    density[model.used] = -0.5 * (model.precision * u[model.used] ** 2 + np.log1p(information / model.precision))
    return density, precision
