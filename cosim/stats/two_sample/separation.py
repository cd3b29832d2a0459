"""The classifier two-sample test.

Lopez-Paz, Oquab: Revisiting Classifier Two-Sample Tests, ICLR 2017. Boosted trees learn to name the set of a patch.
They are cross-fitted: all patches of a unit (a frame, a block of frames or a drive) are scored by trees that were
trained without it, because patches of a unit resemble each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec

import numpy as np

from cosim.stats.two_sample.figures import CHANNELS, FIGURES
from cosim.stats.two_sample.patches import Patches
from cosim.stats.two_sample.regions import REGIONS, TITLES
from cosim.stats.two_sample.result import (
    ChannelResult,
    FigureResult,
    RegionResult,
    Separation,
    TellingPatch,
    TwoSample,
)

_LEAF, _LEAVES = 20, 10  # patches in a leaf; leaves that few patches are divided into at least


@dataclass(frozen=True)
class TwoSampleSettings:
    """Numeric choices of the test.

    Attributes:
        folds: parts of the cross-fitting.
        draws: of the interval and of the permutations.
        trees: boosting rounds of a classifier.
        leaves: most leaves of a tree.
        telling: patches of each set that are shown.
        fewest_units: of each set; with fewer there is nothing to cross-fit.
    """

    folds: int = 5
    draws: int = 999
    trees: int = 80
    leaves: int = 15
    telling: int = 12
    fewest_units: int = 4


def is_available() -> bool:
    """Whether scikit-learn is installed."""
    return find_spec("sklearn") is not None


def separate_sets(
    a: Patches, b: Patches, rng: np.random.Generator, settings: TwoSampleSettings | None = None
) -> TwoSample:
    """Test whether the patches of `a` can be distinguished from those of the reference `b`.

    Args:
        a, b: patches on one grid, of two units or more each.
        rng: draws folds, trees, intervals and permutations.
        settings: numeric choices.

    """
    settings = settings or TwoSampleSettings()
    folds = min(settings.folds, a.units, b.units)
    fold = [_assign_folds(patches, folds, rng) for patches in (a, b)]
    halves = _split_in_two(b, settings)
    half_folds = [_assign_folds(half, min(folds, b.units // 2), rng) for half in halves or ()]
    channels, scores = [], {}
    for channel in ("all", *CHANNELS):
        columns = np.array([channel in ("all", figure.channel) for figure in FIGURES])
        scores[channel] = _cross_fit((a, b), fold, columns, rng, settings)
        found = _separate((a, b), fold, scores[channel], rng, settings)
        baseline = None
        if halves is not None:
            half_scores = _cross_fit(halves, half_folds, columns, rng, settings)
            baseline = _separate(halves, half_folds, half_scores, rng, settings)
        channels.append(ChannelResult(channel, found, baseline))
    return TwoSample(
        channels=tuple(channels),
        figures=tuple(sorted(_rank_figures(a, b), key=lambda item: -item.auc)),
        regions=tuple(_test_regions(a, b, scores)),
        telling=(_most_telling(a, scores["all"][0], settings), _most_telling(b, 1 - scores["all"][1], settings)),
        information={
            "patches": [len(a), len(b)],
            "units": [a.units, b.units],
            "settings": {name: value for name, value in asdict(settings).items() if name != "telling"},
        },
    )


def pairwise_auc(a: np.ndarray, b: np.ndarray) -> float:
    """Probability that a value of `a` exceeds one of `b`, ties counted half (Mann–Whitney); NaN without values."""
    if not len(a) or not len(b):
        return float("nan")
    ordered = np.sort(b)
    below, upto = np.searchsorted(ordered, a, "left"), np.searchsorted(ordered, a, "right")
    return float((below + upto).sum() / 2 / (len(a) * len(b)))


def _assign_folds(patches: Patches, folds: int, rng: np.random.Generator) -> np.ndarray:
    """Fold of each unit, (units,) int64: as equal in number as can be."""
    return rng.permutation(np.arange(patches.units) % folds)


def _split_in_two(patches: Patches, settings: TwoSampleSettings) -> tuple[Patches, Patches] | None:
    """The first and the second half of the units in their order, so that neighbours in time stay together."""
    middle = patches.units // 2
    if middle < settings.fewest_units:
        return None
    first = patches.unit < middle
    return patches.take(np.flatnonzero(first)), patches.take(np.flatnonzero(~first))


def _cross_fit(
    sets: tuple[Patches, Patches],
    folds: Sequence[np.ndarray],
    columns: np.ndarray,
    rng: np.random.Generator,
    settings: TwoSampleSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """Probability of the first set for every patch of both, by trees trained without its fold."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    figures = np.concatenate([patches.figures[:, columns] for patches in sets])
    truth = np.repeat([1, 0], [len(patches) for patches in sets])
    fold = np.concatenate([of_unit[patches.unit] for of_unit, patches in zip(folds, sets, strict=True)])
    weight = np.where(truth == 1, 0.5 / truth.mean(), 0.5 / (1 - truth.mean()))
    score = np.zeros(len(truth))
    for held in np.unique(fold):
        train, test = fold != held, fold == held
        trees = HistGradientBoostingClassifier(
            max_iter=settings.trees,
            max_leaf_nodes=settings.leaves,
            min_samples_leaf=min(_LEAF, max(int(train.sum()) // _LEAVES, 1)),  # few patches must be split, too
            l2_regularization=1.0,
            early_stopping=False,  # pyright: ignore[reportArgumentType]  # typed as a string by its default "auto"
            random_state=int(rng.integers(2**31)),
        )
        exists = np.isfinite(figures[train]).any(0)  # figures that no patch has, such as runs of zeros without a zero
        if not exists.any():
            score[test] = 0.5
            continue
        trees.fit(figures[train][:, exists], truth[train], weight[train])
        score[test] = trees.predict_proba(figures[test][:, exists])[:, 1]
    return score[: len(sets[0])], score[len(sets[0]) :]


def _separate(
    sets: tuple[Patches, Patches],
    folds: Sequence[np.ndarray],
    scores: tuple[np.ndarray, np.ndarray],
    rng: np.random.Generator,
    settings: TwoSampleSettings,
) -> Separation:
    """AUC within folds, with its interval and p-value; both count whole units."""
    wins, pairs, p_values = [], [], []
    weights = [_resampling(len(of_unit), settings.draws, rng) for of_unit in folds]
    drawn_wins, drawn_pairs = np.zeros(settings.draws), np.zeros(settings.draws)
    for held in np.intersect1d(folds[0], folds[1]):
        units = [np.flatnonzero(of_unit == held) for of_unit in folds]
        values = [
            [score[patches.unit == unit] for unit in rows]
            for patches, score, rows in zip(sets, scores, units, strict=True)
        ]
        table, size = _unit_wins([*values[0], *values[1]])
        first = len(values[0])
        win, pair = table[:first, first:], np.outer(size[:first], size[first:])
        wins.append(win.sum())
        pairs.append(pair.sum())
        left, right = weights[0][:, units[0]], weights[1][:, units[1]]
        drawn_wins += np.einsum("di,ij,dj->d", left, win, right)
        drawn_pairs += np.einsum("di,ij,dj->d", left, pair, right)
        p_values.append(_permutation_p(table, size, first, rng, settings.draws))
    drawn = drawn_wins[drawn_pairs > 0] / drawn_pairs[drawn_pairs > 0]
    low, high = (float(value) for value in np.quantile(drawn, [0.025, 0.975]))
    # Twice the mean of p-values is one whatever their dependence: Vovk, Wang, Biometrika 107 (2020) 791.
    return Separation(float(sum(wins) / sum(pairs)), low, high, min(1.0, 2 * float(np.mean(p_values))))


def _resampling(units: int, draws: int, rng: np.random.Generator) -> np.ndarray:
    """Number of times that each unit is drawn, (draws, units)."""
    return rng.multinomial(units, np.full(units, 1 / units), size=draws).astype(float)


def _unit_wins(values: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of patches in which that of unit i scores higher than that of unit j, (u, u), and patches by unit."""
    table = np.zeros((len(values), len(values)))
    for row, left in enumerate(values):
        for column, right in enumerate(values[row + 1 :], row + 1):
            table[row, column] = pairwise_auc(left, right) * len(left) * len(right)
            table[column, row] = len(left) * len(right) - table[row, column]
    return table, np.array([len(value) for value in values], float)


def _permutation_p(table: np.ndarray, size: np.ndarray, first: int, rng: np.random.Generator, draws: int) -> float:
    """Share of permutations of the held-out units' sets with at least this AUC; the classifier is not refitted."""

    def auc(order: np.ndarray) -> float:
        left, right = order[:first], order[first:]
        return table[np.ix_(left, right)].sum() / (size[left].sum() * size[right].sum())

    found = auc(np.arange(len(size)))
    higher = sum(auc(rng.permutation(len(size))) >= found - 1e-12 for _ in range(draws))
    return (1 + higher) / (1 + draws)


def _rank_figures(a: Patches, b: Patches) -> list[FigureResult]:
    results = []
    for column, figure in enumerate(FIGURES):
        values = [patches.figures[np.isfinite(patches.figures[:, column]), column] for patches in (a, b)]
        if not all(len(value) for value in values):
            continue
        auc = pairwise_auc(*values)
        low, high = np.quantile(np.concatenate(values), [0.005, 0.995])
        edges = np.linspace(low, high if high > low else low + 1, 41)
        shares = np.stack([np.histogram(value.clip(low, high), edges)[0] / len(value) for value in values])
        quantiles = [np.quantile(value, [0.05, 0.25, 0.5, 0.75, 0.95]).tolist() for value in values]
        results.append(
            FigureResult(
                figure.key,
                figure.title,
                figure.channel,
                max(auc, 1 - auc),
                auc > 0.5,
                (quantiles[0], quantiles[1]),
                edges,
                shares,
            )
        )
    return results


def _test_regions(a: Patches, b: Patches, scores: dict[str, tuple[np.ndarray, np.ndarray]]) -> list[RegionResult]:
    results = []
    for column, region in enumerate(REGIONS):
        rows = a.region[:, column], b.region[:, column]
        counts = int(rows[0].sum()), int(rows[1].sum())
        if min(counts):
            auc = {channel: pairwise_auc(one[rows[0]], other[rows[1]]) for channel, (one, other) in scores.items()}
            results.append(RegionResult(region, TITLES[region], counts, auc))
    return results


def _most_telling(patches: Patches, probability: np.ndarray, settings: TwoSampleSettings) -> tuple[TellingPatch, ...]:
    """The patches with the highest probability, at most one a frame while there are enough frames."""
    order = np.argsort(-probability, kind="stable")
    firsts = np.unique(patches.frame[order], return_index=True)[1]
    order = np.concatenate([order[np.sort(firsts)], np.delete(order, firsts)])[: settings.telling]
    return tuple(
        TellingPatch(
            str(patches.frame[row]),
            (int(patches.place[row, 0]), int(patches.place[row, 1])),
            float(probability[row]),
            patches.pictures[row],
        )
        for row in order
    )
