"""The table of scores: everything that selection needs to know about the groups, a few thousand numbers squared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cosim.discrepancy.dictionary.groups import Group, joined
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.dictionary.shared_errors import SharedError, common_information
from cosim.discrepancy.inference.dependence import SPREADS
from cosim.discrepancy.inference.projection import PART, TRACK, Projector
from cosim.discrepancy.inference.random_stratum import RandomStratum
from cosim.discrepancy.selection.calibration import Statistic, family_wise_p
from cosim.discrepancy.selection.gain import (
    Cell,
    Distribution,
    cross_fitted_gain,
    fold_sums,
    folds_of_clusters,
)
from cosim.discrepancy.selection.returns import count_returns, effect_gains, expected_losses
from cosim.discrepancy.settings import Selection

_RIDGE = 1e-2  # of correlations: nearly collinear columns of one group
_ABSORBED = 0.5  # share of the information left below which random effects have absorbed most of an effect


@dataclass(frozen=True, eq=False)
class Entry:
    """Scores of one group.

    Attributes:
        group: the hypothesis.
        tables: (clusters, k) scores by track and by part of a scan.
        cluster_information: (clusters, k) information of each cluster, of both clusterings.
        information: (k, k) with everything fitted eliminated.
        variance: (k,) of the scores' sums under the null, no less than the information implies.
        left: (k,) share of the information that outlives what is fitted.
        cell: for gains.
        is_count: whether score and information count events.
        event: (k,) weight of one event of counts, else 1.
        unit: of the coefficients, in the channel's unit: the reference share for counts, else 1.
        implied: (k,) squares of the scores that independent beams have; empty: the information.
        stratum: what random effects have in common with the group, if the scores are theirs.
        absorbed: (m, k) changes of all random effects that change beams like the columns of an effect; empty where
            beams distinguish it from random effects.
    """

    group: Group
    tables: tuple[np.ndarray, np.ndarray]
    cluster_information: tuple[np.ndarray, np.ndarray]
    information: np.ndarray
    variance: np.ndarray
    left: np.ndarray
    cell: Cell
    is_count: bool
    event: np.ndarray
    unit: float = 1.0
    implied: np.ndarray = field(default_factory=lambda: np.zeros(0))
    stratum: RandomStratum | None = None
    absorbed: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def expected_events(self) -> tuple[np.ndarray, ...]:
        """Expected number (clusters, k) of events of counts, for both clusterings."""
        return tuple(cluster_information / self.event for cluster_information in self.cluster_information)

    @property
    def score(self) -> np.ndarray:
        """(k,) sum over all clusters."""
        return self.tables[TRACK].sum(0)

    @property
    def z(self) -> float:
        """Largest standardised score of a column, by size."""
        return float(np.max(np.abs(self.score) / np.sqrt(np.maximum(self.variance, 1e-300)), initial=0.0))

    @property
    def coefficients(self) -> np.ndarray:
        """(k,) coefficients of one Gauss–Newton step."""
        scale = np.sqrt(np.maximum(np.diag(self.information), 1e-300))
        correlation = self.information / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
        step = np.linalg.solve(correlation, self.score / scale) / scale
        return np.maximum(step, 0) if self.group.one_sided else step

    @property
    def is_of_random(self) -> bool:
        """Whether the scores are those of the random effects, not of the beams: exact fits decide on the group."""
        return self.cell.distribution == "random"

    def p_of_predictions(self) -> float:
        """Bound on the p-value of only this group, from predictions of random effects; 1 if the scores are of beams."""
        return 1.0 if self.stratum is None else self.stratum.p_of_predictions()

    @property
    def start(self) -> np.ndarray:
        """(k,) coefficients from which a fit starts.

        Those of a dependence are 0, except for counts, whose likelihood is no parabola, and where random effects have
        absorbed it.
        """
        is_far = self.group.is_effect or self.is_count or self.is_of_random
        return self.coefficients * self.unit if is_far else np.zeros(self.group.size)


@dataclass(frozen=True, eq=False)
class GroupTest:
    """One group and what its scores show.

    Attributes:
        entry: scores of the group.
        p_value: family-wise.
        gain: log-likelihood on clusters that took no part in the fit; of both clusterings the smaller one.
        fold_gains: (folds,) of that clustering.
    """

    entry: Entry
    p_value: float
    gain: float
    fold_gains: np.ndarray

    @property
    def group(self) -> Group:
        """The hypothesis."""
        return self.entry.group


def score_groups(
    linearisation: Linearisation, groups: Sequence[Group], projector: Projector, settings: Selection
) -> list[Entry]:
    """Scores of groups; those that everything fitted explains are left out."""
    entries: list[Entry] = []
    folds = _folds_of_beams(projector, settings.folds)
    for part in _chunks([group for group in groups if group.columns], settings.chunk):
        entries += _project(linearisation, part, projector, folds, settings)
    tails = _tail_by_channel(entries)
    entries = [_with_dispersion(entry, tails) for entry in entries]
    for group in groups:
        if group.direct is not None:
            entry = _direct(linearisation, group, projector, folds, settings)
            if entry is not None:
                entries.append(entry)
    return entries


def score_shared(
    linearisation: Linearisation,
    shared: Sequence[SharedError],
    selected: Sequence[str],
    clusters: tuple[np.ndarray, np.ndarray],
    folds: int,
) -> list[Entry]:
    """Scores of variances of shared errors, those of the same quantity that were selected eliminated.

    Args:
        linearisation: of the model.
        shared: all of them.
        selected: names of the groups that were selected.
        clusters: (n,) int track, and part of a scan, of each beam.
        folds: number of folds.
    """
    entries, sample = [], linearisation.sample
    for one in shared:
        if one.group.name in selected:
            continue
        score, own_information = _direct_scores(one.group)
        whole, floor = float(own_information.sum()), one.weighted
        left = whole
        for other in shared:
            if other.group.name not in selected or (information := _joint(linearisation, one, other)) is None:
                continue
            other_score, other_information = _direct_scores(other.group)
            own = max(float(other_information.sum()), 1e-300)
            of_other, of_one = (common_information(*pair, information, sample) for pair in ((one, other), (other, one)))
            score = score - of_other / own * other_score
            left = left - of_other * of_one / own
        if left <= 0.05 * whole or whole <= 0:
            continue
        tables, cluster_information = _summed(score, clusters), _summed(own_information, clusters)
        variance = np.array([max(float((table**2).sum()) for table in tables)])
        variance = np.maximum(variance, floor * left / whole)
        gains = tuple(
            _shared_gains(one, score, own_information, cluster, kind, folds) for kind, cluster in enumerate(clusters)
        )
        cell = Cell("normal", np.array([[left]]), True, max(floor / whole, 1.0), gains)
        share = np.array([left / whole])
        entries.append(
            Entry(one.group, tables, cluster_information, np.array([[left]]), variance, share, cell, False, np.ones(1))
        )
    return entries


def _joint(linearisation: Linearisation, one: SharedError, other: SharedError) -> np.ndarray | None:
    """Information (n,) that beams have about the changes of both channels together; None for different quantities."""
    first, second = (linearisation.channels[each.group.channel.removeprefix("shared_")] for each in (one, other))
    if first.quantity != second.quantity:
        return None
    sample = linearisation.sample
    information = linearisation.evidence.information[first.quantity] * first.slope * second.slope
    return np.where(sample.clear & sample.first, information, 0.0)


def _shared_gains(
    one: SharedError, score: np.ndarray, information: np.ndarray, cluster: np.ndarray, kind: int, folds: int
) -> np.ndarray:
    """Gains (folds,) of the variance that is the best for the other folds."""
    fold = folds_of_clusters(int(cluster.max(initial=-1)) + 1, folds, kind)[cluster]
    scores, known = (np.bincount(fold, values, folds) for values in (score, information))
    variance = np.maximum(scores.sum() - scores, 0) / np.maximum(known.sum() - known, 1e-300)
    return np.bincount(fold, one.gain(score, variance[fold]), folds)


def evaluate(
    entries: Sequence[Entry], settings: Selection, rng: np.random.Generator, tested_per_kept: float = 1.0
) -> list[GroupTest]:
    """Family-wise p-values and cross-fitted gains of all groups together, the largest gain first."""
    if not entries:
        return []
    ends = np.cumsum([len(entry.variance) for entry in entries])
    tables = [_stacked([entry.tables[kind] for entry in entries]) for kind in (TRACK, PART)]
    variance = np.concatenate([entry.variance for entry in entries])
    statistics = []
    for entry, end in zip(entries, ends, strict=True):
        columns = np.arange(end - len(entry.variance), end)
        scale = np.sqrt(np.maximum(np.diag(entry.information), 1e-300))
        correlation = entry.information / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
        expected = entry.expected_events if entry.is_count else None
        statistics.append(
            Statistic(columns, np.linalg.inv(correlation), entry.group.one_sided, expected,
                      entry.group.is_clustered_by_scan)
        )  # fmt: skip
    scaled = [_in_events(table, entries, ends) for table in tables]
    p_values = family_wise_p(scaled, variance, statistics, settings.draws, rng, tested_per_kept)
    results = []
    for entry, p_value in zip(entries, p_values, strict=True):
        gains = [
            _gain(entry, kind, settings.folds)
            for kind in (TRACK, PART)
            if kind == TRACK or entry.group.is_clustered_by_scan
        ]
        fewest = min(gains, key=lambda values: float(values.sum()))
        results.append(GroupTest(entry, float(p_value), float(fewest.sum()), fewest))
    best: dict[str, GroupTest] = {}
    for result in sorted(results, key=lambda result: -result.gain):
        best.setdefault(result.group.name, result)  # of a group that beams and random effects inform about
    return list(best.values())


def _project(
    linearisation: Linearisation,
    groups: list[Group],
    projector: Projector,
    folds: list[np.ndarray],
    settings: Selection,
) -> list[Entry]:
    """Entries of groups with columns, before their gains know the dispersion; `folds` as of `_folds_of_beams`."""
    found, entries, end = projector.project(joined(groups, len(linearisation.sample))), [], 0
    for group in groups:
        own = slice(end, end + group.size)
        end += group.size
        information, left = found.information[own, own], found.left[own]
        if left.max(initial=0.0) < settings.least_left or not np.diag(information).max(initial=0.0) > 0:
            continue
        is_of_random = bool(found.is_of_random[own].all())
        absorbed = np.zeros((0, 0))
        if group.is_effect and (is_of_random or left.max() < _ABSORBED):
            absorbed = projector.of_all(found.random[:, own])
        if is_of_random or (group.is_effect and group.size == 1):
            entries += _of_random(group, found.random[:, own], absorbed, projector, settings)
        if is_of_random:
            continue
        tables = found.tables[TRACK][:, own], found.tables[PART][:, own]
        cluster_information = found.cluster_information[TRACK][:, own], found.cluster_information[PART][:, own]
        scatter = np.maximum(*((table**2).sum(0) for table in tables))
        variance = np.maximum(scatter, found.floor[own])
        event = np.ones(group.size)
        unit = linearisation.sample.settings.likelihood.reference_share if group.is_count else 1.0
        diagonal = np.diag(information)
        distribution, gains = _distribution_of(group), ()
        if distribution == "probability":
            losses = expected_losses(linearisation, group)
            variance = np.maximum(variance, diagonal * np.maximum(settings.fewest_events / np.maximum(losses, 1e-9), 1))
            gains = tuple(count_returns(linearisation, group, fold, settings.folds).gain() for fold in folds)
        elif group.is_effect and group.size == 1 and set(group.columns) == {"drop"}:
            distribution, derivative = "probability", group.columns["drop"].toarray().ravel()
            gains = tuple(effect_gains(linearisation, derivative, folds, settings.folds))
        if group.is_count:
            event = _event_weight(linearisation, group)
            variance = np.maximum(variance, diagonal * event)
        cell = Cell(distribution, information, group.one_sided, 1.0, gains)
        implied = np.zeros(0)
        if set(group.columns) == {"drop"}:  # losses that were not expected have another variance than the information
            implied = group.columns["drop"].power(2).T @ linearisation.evidence.score["drop"] ** 2
        entries.append(
            Entry(
                group, tables, cluster_information, information, variance, left, cell, group.is_count, event, unit,
                implied, absorbed=absorbed,
            )
        )  # fmt: skip
    return entries


def _of_random(
    group: Group, x: np.ndarray, absorbed: np.ndarray, projector: Projector, settings: Selection
) -> list[Entry]:
    """Entry of a group from what the random effects have in common with it; none if they have nothing.

    Args:
        group: the hypothesis.
        x: (a, k) coefficients of its columns in a regression on the random effects.
        absorbed: as in `Entry`.
        projector: of these scores.
        settings: numeric choices.
    """
    stratum = projector.random_stratum(x, group.one_sided)
    if stratum is None:
        return []
    tables, cluster_information = stratum.tables()
    gains = tuple(
        stratum.gain(folds_of_clusters(count, settings.folds, kind)[cluster], settings.folds)
        for kind, (cluster, count) in enumerate(zip(stratum.clusters, stratum.counts, strict=True))
    )
    scatter = np.maximum(*((table**2).sum(0) for table in tables))
    cell = Cell("random", stratum.information, group.one_sided, 1.0, gains)
    variance = np.maximum(scatter, np.diag(stratum.information))
    ones = np.ones(group.size)
    return [
        Entry(
            group, tables, cluster_information, stratum.information, variance, ones, cell, False, ones,
            stratum=stratum, absorbed=absorbed,
        )
    ]  # fmt: skip


def _direct(
    linearisation: Linearisation, group: Group, projector: Projector, folds: list[np.ndarray], settings: Selection
) -> Entry | None:
    """Entry of a group of one column whose scores no derivative gives."""
    assert group.direct is not None
    score, information = group.direct
    tables, cluster_information, sample = (
        _summed(score, projector.clusters),
        _summed(information, projector.clusters),
        linearisation.sample,
    )
    scatter = np.array([max(float((table**2).sum()) for table in tables)])
    whole = float(information.sum())
    if whole <= 0:  # a whole setting without fitted coefficients: the score of a beam is its gain
        whole = max(float(scatter[0]), 1e-300)
        gains = tuple(np.bincount(fold, score, settings.folds) for fold in folds)
        cell = Cell("normal", np.array([[whole]]), True, 1.0, gains)
        cluster_information = tables[TRACK] ** 2, tables[PART] ** 2
        return Entry(
            group, tables, cluster_information, np.array([[whole]]), scatter, np.ones(1), cell, False, np.ones(1)
        )
    events = score > 0.2
    weight = float((score[events] * sample.share[events]).sum() / max(float(score[events].sum()), 1e-9)) or 1.0
    event = np.array([max(weight, 1e-3)])
    total = np.array([[whole]])
    cell = Cell("count", total, True, max(float(event[0]), 1.0))
    variance = np.maximum(scatter, whole * event)
    return Entry(group, tables, cluster_information, total, variance, np.ones(1), cell, True, event)


def _direct_scores(group: Group) -> tuple[np.ndarray, np.ndarray]:
    assert group.direct is not None  # of shared errors
    return group.direct


def _distribution_of(group: Group) -> Distribution:
    if group.is_effect or group.basis is None:
        return "normal"
    if group.is_count:
        return "count"
    if group.channel == "drop":
        return "probability"
    return "spread" if group.channel in SPREADS else "normal"


def _event_weight(linearisation: Linearisation, group: Group) -> np.ndarray:
    """(k,) mean weight of the events in each column of a count."""
    score = np.maximum(linearisation.evidence.score[group.channel], 0)  # type: ignore[index]
    assert group.basis is not None
    whole = group.basis.T @ score
    weighted = group.basis.T @ (score * linearisation.sample.share)
    return np.where(whole > 0, weighted / np.maximum(whole, 1e-12), 1.0)


def _tail_by_channel(entries: Sequence[Entry]) -> dict[str, float]:
    """By channel, how much the squared scores of a typical column exceed what the weights of the beams imply.

    The scores are those about the column's own step: otherwise a strong effect would count as scatter between clusters.
    """
    ratios: dict[str, list[np.ndarray]] = {}
    for entry in entries:
        scatter = np.maximum(*map(_scatter, entry.tables, entry.cluster_information))
        implied = entry.implied if len(entry.implied) else np.diag(entry.information)
        ratios.setdefault(entry.group.channel, []).append(scatter / np.maximum(implied, 1e-300))
    return {channel: max(float(np.median(np.concatenate(values))), 0.3) for channel, values in ratios.items()}


def _scatter(table: np.ndarray, information: np.ndarray) -> np.ndarray:
    """Sum (k,) of the squared scores (clusters, k) about their weighted mean, for clusters with information."""
    share = information / np.maximum(information.sum(0), 1e-300)
    count = np.count_nonzero(information > 0, axis=0)
    about_mean = ((table - share * table.sum(0)) ** 2).sum(0)
    return about_mean * count / np.maximum(count - 1, 1)


def _with_dispersion(entry: Entry, tails: dict[str, float]) -> Entry:
    if entry.group.is_count:
        weight = np.maximum(entry.score, 0) + 1e-9
        dispersion = float(np.average(entry.event, weights=weight))
    elif entry.cell.distribution == "probability":  # no scale can be smaller than that of Bernoulli trials
        dispersion = max(tails[entry.group.channel], 1.0)
    else:
        dispersion = tails[entry.group.channel]
    return replace(entry, cell=replace(entry.cell, dispersion=max(dispersion, 1e-3)))


def _summed(score: np.ndarray, clusters: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    track, part = (np.bincount(cluster, score)[:, None] for cluster in clusters)
    return track, part


def _gain(entry: Entry, kind: int, folds: int) -> np.ndarray:
    """Gain (folds,) over the clusters of one kind."""
    if entry.cell.distribution == "random":
        return entry.cell.fold_gains[kind]
    if entry.cell.fold_gains:
        return entry.cell.fold_gains[kind] / entry.cell.dispersion
    return cross_fitted_gain(*_folded(entry, kind, folds), entry.cell)


def _folds_of_beams(projector: Projector, folds: int) -> list[np.ndarray]:
    """Fold (n,) int of each beam, for both clusterings: all beams of a cluster are in one fold."""
    counts = [int(cluster.max(initial=-1)) + 1 for cluster in projector.clusters]
    return [
        folds_of_clusters(count, folds, kind)[cluster]
        for kind, (count, cluster) in enumerate(zip(counts, projector.clusters, strict=True))
    ]


def _folded(entry: Entry, kind: int, folds: int) -> tuple[np.ndarray, np.ndarray]:
    """Scores and information (folds, k) of random folds of the clusters."""
    table, information = entry.tables[kind], entry.cluster_information[kind]
    fold = folds_of_clusters(len(table), folds, kind)
    return fold_sums(table, fold, folds), fold_sums(information, fold, folds)


def _in_events(table: np.ndarray, entries: Sequence[Entry], ends: np.ndarray) -> np.ndarray:
    """A table with the columns of counts in events."""
    table = table.copy()
    for entry, end in zip(entries, ends, strict=True):
        if entry.is_count:
            table[:, end - len(entry.variance) : end] /= entry.event
    return table


def _stacked(tables: Sequence[np.ndarray]) -> np.ndarray:
    """Tables side by side; shorter ones get clusters without scores."""
    rows = max(len(table) for table in tables)
    return np.hstack([np.vstack([table, np.zeros((rows - len(table), table.shape[1]))]) for table in tables])


def _chunks(groups: Sequence[Group], most: int) -> list[list[Group]]:
    """Groups of the same quantities together, at most so many columns at a time."""
    ordered = sorted(groups, key=lambda group: sorted(group.columns))
    parts: list[list[Group]] = []
    for group in ordered:
        fits = bool(parts) and set(parts[-1][0].columns) == set(group.columns)
        if fits and sum(other.size for other in parts[-1]) + group.size <= most:
            parts[-1].append(group)
        else:
            parts.append([group])
    return parts
