"""Is anything missing? A score test of every group at once, random effects and fitted parameters eliminated.

Of each group the scores are summed by track and by scan. Where nothing is missing such sums have random signs, so that
drawing signs gives the law of the largest statistic of all groups (wild cluster bootstrap, Cameron, Gelbach and Miller
2008; max-T, Westfall and Young 1993). The less favourable of the two clusterings counts.

With X the group's columns, Z those of the random effects u of precision Λ, and A = (ZᵀWZ + Λ)⁻¹ZᵀWX, the score of the
group with u eliminated is (X − ZA)ᵀs(û) + AᵀΛû. The first part is summed by cluster; the second, what the random
effects themselves say, by what each of them is of: an object, a cell of the map, a scan.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import sparse

from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.random_effects import Clusters, Estimate
from cosim.discrepancy.inference.score import QUANTITIES, Quantity, SparseMatrix, ridged, scaled, summed_by
from cosim.discrepancy.inference.wild_bootstrap import deviates, family_wise
from cosim.discrepancy.settings import Screen, Settings
from sensors.effects.base import Effect

Channel = Literal["range", "intensity", "drop", "spurious", "range_variance", "intensity_variance", "pose"]


@dataclass(frozen=True, eq=False)
class Strays:
    """Returns from nowhere that the weak form of an effect adds.

    Attributes:
        expected: (n,) how many take the place of a beam's own return, in beams of the sample.
        step: amplitude of that form.
        each: what one weighs, in beams of the sample.
        gain: log-likelihood by which the form explains one better than none does.
    """

    expected: np.ndarray
    step: float
    each: float
    gain: float


@dataclass(frozen=True, eq=False)
class Group:
    """Columns of one catalogue effect, or of a dependence that no effect is named for.

    Attributes:
        name: of the effect; or `CHANNEL by COVARIATE`.
        channel: what is off.
        columns: (n, k) by quantity: its change with a unit of each of k numbers.
        size: k.
        covariates: names of what a dependence is on; empty for effects.
        one_sided: whether only a positive amplitude makes sense.
        by_scan: whether errors that a scan shares could make it; not asked where it is about scans itself.
        start: the effect, weakly on.
        amplitude: its parameter that the column is of; empty for whole settings, and for dependences.
        label: its other parameters, for people.
        place: where the effect stands among the sensor's, if it is there already.
        gain: (n,) what the weak form adds to every beam's log-likelihood, for effects that no slope tells of.
        strays: what it adds, if it adds strays.
        begun: random effects that a fit of it starts from; those that there are by default.
    """

    name: str
    channel: str
    columns: dict[Quantity, SparseMatrix]
    size: int
    covariates: tuple[str, ...] = ()
    one_sided: bool = False
    by_scan: bool = True
    start: Effect | None = None
    amplitude: str = ""
    label: str = ""
    place: int | None = None
    gain: np.ndarray | None = None
    strays: Strays | None = None
    begun: Estimate | None = None

    @property
    def is_effect(self) -> bool:
        """Whether it is an effect with a name."""
        return self.start is not None


@dataclass(frozen=True, eq=False)
class Tested:
    """One group and what the data say of it.

    Attributes:
        group: what was asked.
        value: statistic as a standard normal deviate.
        p_value: family-wise, of this group.
        gain: log-likelihood that the linear model foresees.
        step: (k,) amplitudes at which it would be reached.
        smallest: amplitude that would be found with 80 % power; NaN where there is none.
        error: standard error of a single amplitude; NaN of several.
    """

    group: Group
    value: float
    p_value: float
    gain: float
    step: np.ndarray
    smallest: float
    error: float


@dataclass(frozen=True, eq=False)
class _Sums:
    """Scores of one group by cluster."""

    group: Group
    track: np.ndarray
    scan: np.ndarray
    slope: np.ndarray
    information: np.ndarray
    expected: tuple[np.ndarray, ...] = ()


def screen(
    model: LinearModel,
    estimate: Estimate,
    groups: Sequence[Group],
    clusters: Clusters,
    settings: Settings,
    rng: np.random.Generator,
    beside: dict[Quantity, SparseMatrix] | None = None,
) -> list[Tested]:
    """Test all groups, the surest first.

    Args:
        model: linear about the fit.
        estimate: its random effects.
        groups: to ask for.
        clusters: of beams.
        settings: numbers that decide.
        rng: for the signs.
        beside: further columns (n, k) by quantity whose parameters are free, too.
    """
    projector, by = Projector(model, estimate, clusters, beside), settings.screen
    sums: list[_Sums] = [_gained(one, clusters) for one in groups if one.gain is not None]
    linear = [one for one in groups if one.gain is None and one.columns]
    for part in _chunks(linear, by.chunk):
        sums += projector.sums(part, by)
    if not sums:
        return []
    one_sided = np.array([one.group.one_sided for one in sums])
    tracks, scans = [one.track for one in sums], [one.scan for one in sums]
    values, p_values, critical = family_wise(
        ((tracks, _calmer(sums, tracks)), (scans, _calmer(sums, scans))), one_sided, by.draws, settings.level, rng
    )
    found = [
        _told(one, float(value), float(p), critical + by.power, by)
        for one, value, p in zip(sums, values, p_values, strict=True)
    ]
    return sorted(found, key=lambda one: (one.p_value, -one.value))


class Projector:
    """Sums scores of columns by cluster, with what is fitted and not known taken out of the columns."""

    def __init__(
        self,
        model: LinearModel,
        estimate: Estimate,
        clusters: Clusters,
        beside: dict[Quantity, SparseMatrix] | None = None,
    ) -> None:
        self._model = model if beside is None else model.beside(beside)
        self._scores = model.evidence.score
        self._clusters = [clusters.track, clusters.part]
        self._counts = [int(one.max(initial=-1)) + 1 for one in self._clusters]
        self._of_known = [self._known(*of) for of in zip(self._clusters, self._counts, strict=True)]
        told = estimate.u[model.used] * model.precision
        track, scan = clusters.unit_track[model.used], clusters.unit_scan[model.used]
        tracks, parts = self._counts
        scans = int(clusters.scan.max(initial=-1)) + 1
        by_track = np.where(track >= 0, track, tracks + scan)
        by_part = np.where(track >= 0, parts + scans + track, parts + scan)
        at = np.arange(len(told))
        self._rows: list[SparseMatrix] = [
            sparse.csr_matrix((told, (by_track, at)), (tracks + scans, len(told))),
            sparse.csr_matrix((told, (by_part, at)), (parts + scans + tracks, len(told))),
        ]

    def of(self, columns: dict[Quantity, SparseMatrix]) -> tuple[list[np.ndarray], np.ndarray]:
        """Scores of columns (n, k) by cluster, a table (clusters, k) for each clustering; their information (k, k)."""
        known, shared = self._model.projected(columns)
        tables = self._summed(columns, known)
        information = self._model.evidence.information
        width = tables[0].shape[1]
        whole = np.zeros((width, width))
        for name, one in columns.items():
            whole += np.asarray((one.T @ scaled(one, information[name])).todense())
        return tables, whole - shared.T @ known

    def _summed(self, columns: dict[Quantity, SparseMatrix], known: np.ndarray) -> list[np.ndarray]:
        """Scores by cluster, a table (clusters, k) for each clustering."""
        tables = []
        for cluster, count, of_known, rows in zip(
            self._clusters, self._counts, self._of_known, self._rows, strict=True
        ):
            found = np.asarray(rows @ known[: rows.shape[1]])
            for name, one in columns.items():
                found[:count] += summed_by(cluster, one, self._scores[name], count)
            found[:count] -= of_known @ known
            tables.append(found)
        return tables

    def sums(self, groups: Sequence[Group], by: Screen) -> list[_Sums]:
        """Of some groups; those that what is fitted explains are left out."""
        ends = np.cumsum([one.size for one in groups])
        columns = _joined(groups, len(next(iter(self._scores.values()))))
        known, shared = self._model.projected(columns)
        by_cluster = self._summed(columns, known)
        weighted = {name: scaled(one, self._model.evidence.information[name]) for name, one in columns.items()}
        share = self._told_by(columns)
        found = []
        for one, end in zip(groups, ends, strict=True):
            mine = slice(end - one.size, end)
            whole = sum(
                (np.asarray((columns[name][:, mine].T @ weighted[name][:, mine]).todense()) for name in columns),
                np.zeros((one.size, one.size)),
            )
            left = whole - shared[:, mine].T @ known[:, mine]
            if np.trace(left) <= by.left * np.trace(whole) or np.trace(whole) <= 0:
                continue
            outlived = np.maximum(np.diag(left), 0) / np.maximum(np.diag(whole), 1e-300)
            slope = by_cluster[0][:, mine].sum(0)
            with np.errstate(invalid="ignore"):  # what random effects say has no bound, however little outlives them
                track, scan = (
                    _bounded(table[:, mine], of_each[:, mine] * outlived, by.plain)
                    for table, of_each in zip(by_cluster, share, strict=True)
                )
            found.append(_Sums(one, track, scan if one.by_scan else track, slope, left))
        return found

    def _told_by(self, columns: dict[Quantity, SparseMatrix]) -> list[np.ndarray]:
        """Information of columns by cluster, tables (clusters, k); no bound for what the random effects say."""
        tables = []
        for cluster, count, rows in zip(self._clusters, self._counts, self._rows, strict=True):
            found = np.zeros((rows.shape[0], next(iter(columns.values())).shape[1]))
            found[count:] = np.inf
            for name, one in columns.items():
                found[:count] += summed_by(cluster, one.power(2), self._model.evidence.information[name], count)
            tables.append(found)
        return tables

    def _known(self, cluster: np.ndarray, count: int) -> np.ndarray:
        """(clusters, a + p) scores of the random effects' and the parameters' own columns."""
        parts = []
        for own, size in ((self._model.z, len(self._model.used)), (self._model.x, self._model.parameters)):
            found = np.zeros((count, size))
            for name, one in own.items():
                if one.nnz:
                    found += summed_by(cluster, one, self._scores[name], count)
            parts.append(found)
        return np.hstack(parts)


def _calmer(sums: Sequence[_Sums], tables: Sequence[np.ndarray]) -> np.ndarray:
    """By how much sums scatter less than the model says: what is tiny beside its noise is none, however regular."""
    found = np.ones(len(sums))
    for row, (one, table) in enumerate(zip(sums, tables, strict=True)):
        if one.group.gain is None:
            known = float(np.trace(one.information))
            found[row] = max(np.sqrt(known / max(float((table**2).sum()), 1e-300)), 1.0)
    return found


def _told(one: _Sums, value: float, p_value: float, needed: float, by: Screen) -> Tested:
    group = one.group
    if group.gain is not None:
        gain = float(group.gain.sum()) if group.is_effect else 0.0
        return Tested(group, value, p_value, gain, np.ones(1), _countable(one, needed, by), float("nan"))
    information = ridged(one.information)
    step = np.linalg.solve(information, one.slope)
    if group.one_sided and step[0] < 0:
        step = np.zeros(1)
    wider = max(_dispersion(table, one) for table in (one.track, one.scan))
    gain = 0.5 * float(one.slope @ step)
    error = float(np.sqrt(wider / information[0, 0])) if group.size == 1 else float("nan")
    smallest = needed * float(np.sqrt(wider / information.sum())) if group.amplitude else float("nan")
    return Tested(group, value, p_value, gain, step, smallest, error)


def _dispersion(table: np.ndarray, one: _Sums) -> float:
    """How much wider sums over clusters scatter than the model says, what is common to all taken out; at least 1."""
    count = max(np.count_nonzero(np.abs(table).sum(1)), 2)
    apart = (table**2).sum(0) - table.sum(0) ** 2 / count
    known = np.maximum(np.diag(one.information), 1e-300)
    return max(float(np.mean(apart / known)), 1.0)


def _gained(group: Group, clusters: Clusters) -> _Sums:
    """Gains by cluster, large ones as their logarithms: a single ghost of many beams must not drown all others."""
    assert group.gain is not None  # asked before
    both = (clusters.track, clusters.part)
    track, scan = (compressed(np.bincount(cluster, group.gain))[:, None] for cluster in both)
    expected: tuple[np.ndarray, ...] = ()
    if group.strays is not None:
        expected = tuple(np.bincount(cluster, group.strays.expected) for cluster in both)
    return _Sums(group, track, scan, track.sum(0), np.eye(1), expected)


def _countable(one: _Sums, needed: float, by: Screen) -> float:
    """Amplitude of strays that would be found: Poisson counts by cluster beside what there is already; NaN for none."""
    strays = one.group.strays
    if strays is None:
        return float("nan")
    worth = strays.each * strays.gain

    def reached(times: float) -> float:
        found = []
        for sums, expected in zip((one.track, one.scan), one.expected, strict=True):
            count = times * expected / strays.each
            mean, there = worth * count - expected, sums[:, 0] + expected
            typical = compressed(np.sqrt(mean**2 + worth**2 * count + there**2))
            z = float(compressed(mean).sum() / max(np.linalg.norm(typical), 1e-300))
            found.append(float(deviates(np.array([z]), typical)[0]))
        return min(found)

    grid = np.geomspace(1 / by.most_times, by.most_times, by.times)
    row = bisect_left(grid, needed, key=reached)
    return float(grid[row] * strays.step) if row < len(grid) else float("nan")


def compressed(gain: np.ndarray) -> np.ndarray:
    """Sizes of gains (n,) as logarithms, with their signs; random signs stay random."""
    return np.sign(gain) * np.log1p(np.abs(gain))


def _bounded(score: np.ndarray, information: np.ndarray, plain: float) -> np.ndarray:
    """Scores by cluster, beyond some standard deviations only growing as their logarithms.

    Where an effect is plain, few objects that have most of the beams must not outvote that all others agree.
    """
    sigma = np.sqrt(np.maximum(np.nan_to_num(information, nan=np.inf), 1e-300))
    beyond = np.maximum(np.abs(score) / (plain * sigma), 1.0)
    return score / beyond * (1 + np.log(beyond))


def _joined(groups: Sequence[Group], rows: int) -> dict[Quantity, SparseMatrix]:
    found: dict[Quantity, SparseMatrix] = {}
    for name in QUANTITIES:  # in the same order each time
        if any(name in one.columns for one in groups):
            parts = [one.columns.get(name, sparse.csr_matrix((rows, one.size))) for one in groups]
            found[name] = sparse.hstack(parts, format="csc")
    return found


def _chunks(groups: Sequence[Group], most: int) -> list[list[Group]]:
    found: list[list[Group]] = [[]]
    width = 0
    for one in groups:
        if width + one.size > most and found[-1]:
            found.append([])
            width = 0
        found[-1].append(one)
        width += one.size
    return [part for part in found if part]
