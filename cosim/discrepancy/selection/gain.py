"""Gains in log-likelihood that a group would bring on clusters that took no part in its fit.

Means of continuous quantities: parabolas. Counts and spreads: exact deviances, because parabolas rank strong effects
wrongly. Probabilities of returns: see `returns`; what random effects have in common: see `random_stratum`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Distribution = Literal["normal", "count", "probability", "spread", "random"]


@dataclass(frozen=True, eq=False)
class Cell:
    """Scores of one group.

    Attributes:
        distribution: of the likelihood about a change.
        information: (k, k).
        one_sided: whether only positive coefficients make sense.
        dispersion: by how much squared scores exceed the information; gains are divided by it.
        fold_gains: (folds,) gains by track and by part of a scan, for probabilities and random effects.
    """

    distribution: Distribution
    information: np.ndarray
    one_sided: bool
    dispersion: float
    fold_gains: tuple[np.ndarray, ...] = ()


def folds_of_clusters(count: int, folds: int, kind: int) -> np.ndarray:
    """Random fold (count,) int of each cluster of the clustering `kind`, always the same for the same arguments."""
    return np.random.default_rng([folds, kind]).permutation(count) % folds


def fold_sums(table: np.ndarray, fold: np.ndarray, folds: int) -> np.ndarray:
    """Sums (folds, k) of a table (clusters, k) over the clusters of each fold; `fold` is (clusters,)."""
    return np.stack([table[fold == number].sum(0) for number in range(folds)])


def gain_difference(fold_gains: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """Gain of one hypothesis minus that of another, both (folds,), and the standard error over folds."""
    difference = fold_gains - other
    return float(difference.sum()), float(np.sqrt(len(difference) * difference.var(ddof=1))) + 1e-9


def is_rival(chosen: float, other: float, chosen_folds: np.ndarray, other_folds: np.ndarray) -> bool:
    """Whether another hypothesis could replace the chosen one: its gain is within two standard errors over folds.

    Args:
        chosen, other: gains of exact refits.
        chosen_folds, other_folds: (folds,) cross-fitted gains of the linear model, whose standard error is scaled to
            the exact gains.
    """
    difference, error = gain_difference(chosen_folds, other_folds)
    scale = chosen / max(float(chosen_folds.sum()), 1.0)
    within = chosen - other < max(2 * error * scale, 0.0)
    return within and other > 0.5 * chosen and (difference < 2 * error or other > chosen)


def cross_fitted_gain(sums: np.ndarray, cluster_information: np.ndarray, cell: Cell) -> np.ndarray:
    """Gain (folds,) on each fold of coefficients fitted to the others: Σₖ(θ₋ₖᵀsₖ − ½ θ₋ₖᵀHₖθ₋ₖ) and its analogues.

    Args:
        sums: (folds, k) scores.
        cluster_information: (folds, k) information of each fold, in any common unit.
        cell: of the group.
    """
    diagonal = np.maximum(np.diag(cell.information), 1e-300)
    of_fold = cluster_information / np.maximum(cluster_information.sum(0), 1e-300) * diagonal  # (folds, k)
    # A column of which one fold has nearly all information cannot be fitted to the others: shrunk by half of the whole.
    rest, of_rest = sums.sum(0) - sums, np.maximum(diagonal - of_fold, 0.5 * diagonal)
    if cell.distribution == "normal":
        scale = np.sqrt(diagonal)
        correlation = cell.information / np.outer(scale, scale)
        inverse = np.linalg.inv(correlation + 1e-2 * np.eye(len(scale)))
        coefficients = (rest / np.sqrt(of_rest)) @ inverse / np.sqrt(of_rest)
        coefficients = np.maximum(coefficients, 0) if cell.one_sided else coefficients
        scaled = coefficients * np.sqrt(of_fold)
        curvature = np.einsum("fk,kl,fl->f", scaled, correlation, scaled)
        return ((coefficients * sums).sum(1) - 0.5 * curvature) / cell.dispersion
    coefficients = rest / (1.01 * of_rest)
    coefficients = np.maximum(coefficients, 0) if cell.one_sided else coefficients
    gains = deviance_gain(cell.distribution, coefficients, sums, of_fold)
    return gains.sum(1) / cell.dispersion


def deviance_gain(
    distribution: Distribution,
    coefficients: np.ndarray,
    score: np.ndarray,
    information: np.ndarray,
) -> np.ndarray:
    """Log-likelihood (…, k) gained by coefficients (…, k) where the scores and the information are (…, k).

    Counts: score k − e of k events with e = information expected, change of the expectation by the factor 1 + θ.
    Spreads: change θ of log σ.
    """
    if distribution == "count":
        expected = information
        factor = np.log1p(np.maximum(coefficients, -0.99))
        return np.maximum(expected + score, 0) * factor - expected * np.maximum(coefficients, -0.99)
    half = information / 2
    ratio = np.exp(np.clip(2 * coefficients, *np.log([0.05, 50])))
    return 0.5 * ((score + half) * (1 - 1 / ratio) - half * np.log(ratio))
