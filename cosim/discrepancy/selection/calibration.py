"""Family-wise p-values by random signs of clusters.

Where nothing is missing, the scores of clusters have random signs: drawing signs gives the reference distribution of
every group's statistics at once (wild cluster bootstrap: Cameron, Gelbach and Miller, Rev. Econ. Stat. 2008). A group
has two: the sum of the squared standardised scores of its columns, for a change of many columns, and the largest of
them, for a change of one, such as a dead laser. The test statistic of the family is the smallest p-value of any of them
(min-P: Westfall and Young 1993), so that groups of many columns, of few columns and of rare counts have the same
chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_TAIL = 0.1  # upper share of a reference distribution that a generalised Pareto distribution continues
_HEAVIEST = 0.5  # largest shape of that distribution: beyond, its moments do not exist


@dataclass(frozen=True, eq=False)
class Statistic:
    """One group for the test.

    Attributes:
        columns: of the score tables.
        inverse: (k, k) inverse correlation of the columns under the null.
        one_sided: whether only positive scores count.
        expected: for counts, of each clustering the expected number (clusters, k) of events; None for others.
        is_clustered_by_scan: whether the clustering by parts of scans applies.
    """

    columns: np.ndarray
    inverse: np.ndarray
    one_sided: bool
    expected: tuple[np.ndarray, ...] | None = None
    is_clustered_by_scan: bool = True


def random_signs(clusters: int, draws: int, rng: np.random.Generator) -> np.ndarray:
    """(1 + draws, clusters) signs; the first row is the data's own."""
    return np.vstack([np.ones(clusters), rng.choice((-1.0, 1.0), (draws, clusters))])


def surprise(statistics: np.ndarray, tail: float = _TAIL) -> np.ndarray:
    """−ln p of statistics (1 + draws, groups) against the draws in rows 1 onward.

    Beyond the upper tail of the draws a generalised Pareto distribution continues them, its shape from probability-
    weighted moments (Hosking and Wallis, Technometrics 1987) but with no end: an exponential distribution where the
    tail is light. For permutations: Knijnenburg et al., Bioinformatics 2009.
    """
    reference = np.sort(statistics[1:], 0)
    count = len(reference)
    first = int(count * (1 - tail))
    quantile = reference[first]
    beyond = reference[first:] - quantile
    below = (np.arange(len(beyond)) + 0.65) / len(beyond)  # share of the tail below each value
    mean, lower = beyond.mean(0), (beyond * (1 - below)[:, None]).mean(0)
    shape = np.clip(2 - mean / np.maximum(mean - 2 * lower, 1e-9), 0.0, _HEAVIEST)
    scale = np.maximum(mean * (1 - shape), 1e-9)
    excess = np.maximum(statistics - quantile, 0) / scale
    is_heavy = shape > 1e-6
    found = np.where(is_heavy, np.log1p(shape * excess) / np.where(is_heavy, shape, 1.0), excess) - np.log(tail)
    for group in range(statistics.shape[1]):
        near = statistics[:, group] <= quantile[group]
        rank = np.searchsorted(reference[:, group], statistics[near, group], side="left")
        found[near, group] = -np.log((count + 1 - rank) / (count + 1))
    return found


def min_p(statistics: np.ndarray) -> np.ndarray:
    """Family-wise p-values (groups,) of statistics (1 + draws, groups), of which large ones are significant.

    The smallest p-value of any group is compared with its distribution over the draws (Westfall and Young 1993).
    NaN for a group whose statistic is the same in all draws.
    """
    values, draws = np.cbrt(np.maximum(statistics, 0)), len(statistics) - 1
    live = values[1:].std(0) > 1e-9
    logs = np.where(live, surprise(values), 0.0)
    smallest = np.sort(logs[1:].max(1))
    p = 1 - np.searchsorted(smallest, logs[0], side="left") / draws
    return np.where(live, np.maximum(p, 1 / (draws + 1)), np.nan)


def family_wise_p(
    tables: Sequence[np.ndarray],
    variance: np.ndarray,
    groups: Sequence[Statistic],
    draws: int,
    rng: np.random.Generator,
    tested_per_kept: float = 1.0,
) -> np.ndarray:
    """Family-wise p-values (groups,); of both clusterings the larger one.

    Args:
        tables: scores (clusters, P) by track and by part of a scan.
        variance: (P,) of the sums under the null.
        groups: what is tested.
        draws: sign patterns.
        rng: for the signs.
        tested_per_kept: how many groups a first pass looked at, per group that it kept.
    """
    p_values, root = np.zeros(len(groups)), np.sqrt(np.maximum(variance, 1e-300))
    for number, table in enumerate(tables):
        has_scores = np.abs(table).sum(1) > 0
        used = table[has_scores]
        if not len(used):
            p_values = np.maximum(p_values, 1.0 if number == 0 else 0.0)
            continue
        signs = random_signs(len(used), draws, rng)
        total = signs @ (used / root)
        sums, largest = np.zeros((draws + 1, len(groups))), np.zeros((draws + 1, len(groups)))
        for position, group in enumerate(groups):
            if number == 1 and not group.is_clustered_by_scan:
                continue
            z = total[:, group.columns]
            if group.expected is not None:
                expected = group.expected[number]
                expected = np.pad(expected, ((0, len(table) - len(expected)), (0, 0)))[has_scores]
                z = _count_deviates(used[:, group.columns], expected, signs, rng)
            z = np.maximum(z, 0) if group.one_sided else z
            largest[:, position] = (z**2).max(1)
            sums[:, position] = (z**2).sum(1) if group.one_sided else np.einsum("dk,kl,dl->d", z, group.inverse, z)
        p = np.fmin(*min_p(np.hstack([sums, largest])).reshape(2, -1))
        p = np.nan_to_num(p, nan=1.0 if number == 0 else 0.0)
        p_values = np.maximum(p_values, p)
    return 1 - (1 - np.clip(p_values, 0, 1)) ** tested_per_kept


def _count_deviates(
    scores: np.ndarray, expected: np.ndarray, signs: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Standardised differences (1 + draws, k) of numbers of events from what is expected.

    Events of one cluster may have a common cause. A cluster that expects less than one event therefore counts once,
    whatever its number of events, and Bernoulli draws are its reference; of larger ones random signs are.

    Args:
        scores, expected: (clusters, k) observed minus expected events, and expected events.
        signs: (1 + draws, clusters), of the larger clusters.
        rng: for the draws.
    """
    expected = np.maximum(expected, 0)
    is_small = expected < 1
    chance = np.where(is_small, -np.expm1(-expected), 0.0)  # of one event or more
    excess = np.where(is_small, 0.0, scores)
    small = (is_small & (scores + expected > 0.2)).sum(0)
    draws = len(signs) - 1
    drawn = np.stack([(rng.random((draws, len(p))) < p).sum(1) for p in chance.T], 1)
    variance = chance.sum(0) + np.where(is_small, 0.0, np.maximum(excess**2, expected)).sum(0)
    difference = np.vstack([small[None], drawn]) - chance.sum(0) + signs @ excess
    return difference / np.sqrt(np.maximum(variance, 1e-6))
