"""Is anything missing at all? A score test that knows that returns share errors.

Every candidate's slope of the log-likelihood is summed by track and by scan. Under "nothing missing" the sums have
random signs, so drawing signs gives the distribution of the largest of all candidates' statistics (max-T; Cameron,
Gelbach, Miller 2008 on wild cluster bootstraps; Westfall, Young 1993 on max-T). The less favourable of the two
clusterings counts. Errors of the map reach over many of its cells, and errors of poses over many scans: sums that show
it count as so much wider.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import sparse

from cosim.discrepancy.detectable import Z80, smallest_amplitude
from cosim.discrepancy.inference.clusters import Clusters, compressed, widened
from cosim.discrepancy.inference.columns import Column, SparseMatrix
from cosim.discrepancy.inference.score import Evidence, Quantity
from cosim.discrepancy.inference.wild_bootstrap import DRAWS, family_wise
from sensors.effects.base import Effect

_KEPT_SHARE = 0.02  # of a candidate's information that must outlive the fit of pose errors
_FEWEST_SCANS = 5
_OF_WHERE: tuple[Quantity, ...] = ("range", "rise")  # both tell where a beam looks
_MOST_LIKE = 0.8
_PLAIN = 3.0


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
class Direction:
    """One way to look for an effect.

    Attributes:
        effect: its name.
        label: parameter and shape, for people.
        amplitude: parameter that the column's unit is of; empty for shapes without one.
        column: what a unit of it changes.
        start: the effect, weakly on.
        place: where it stands among the sensor's effects, if it is there already.
        one_sided: whether only a positive amplitude makes sense.
        gain: (n,) what the weak form adds to every beam's log-likelihood: for effects that replace the answering
            surface, which no slope tells of.
        strays: what it adds, if it adds strays.
        moved: (n,) the column's change of ranges with its longest tails.
    """

    effect: str
    label: str
    amplitude: str
    column: Column
    start: Effect | None = None
    place: int | None = None
    one_sided: bool = False
    gain: np.ndarray | None = None
    strays: Strays | None = None
    moved: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Statistic:
    """One candidate in one channel.

    Attributes:
        direction: what was looked for.
        quantity: where.
        value: equivalent standard normal deviate.
        p_value: family-wise over all candidates and channels.
        smallest: amplitude that would be found with 80 % power, in the parameter's unit; NaN where there is none.
    """

    direction: Direction
    quantity: Quantity | Literal["likelihood", "poses"]
    value: float
    p_value: float
    smallest: float


@dataclass(frozen=True, eq=False)
class Verdict:
    """All statistics, the strongest first, and the smallest p-value of all."""

    statistics: tuple[Statistic, ...]
    p_value: float

    def of(self, effect: str) -> Statistic | None:
        """The strongest statistic of an effect."""
        return next((one for one in self.statistics if one.direction.effect == effect), None)

    def unclaimed(self, effects: Collection[str]) -> Verdict:
        """The same, but nothing said of what would have been found of some effects."""
        told = (replace(one, smallest=np.nan) if one.direction.effect in effects else one for one in self.statistics)
        return replace(self, statistics=tuple(told))


@dataclass(frozen=True, eq=False)
class Posed:
    """What the fitted pose errors say of one candidate, see `pose_patterns.py`.

    Attributes:
        direction: what was looked for.
        deviate: how well they follow its pattern, as a standard normal deviate.
        p_value: of its own.
        error: standard error of its amplitude.
        unit: (6·scans,) its pattern in units of the errors' spread, of length 1.
    """

    direction: Direction
    deviate: float
    p_value: float
    error: float
    unit: np.ndarray


@dataclass(frozen=True, eq=False)
class Sums:
    """Scores of one candidate in one channel summed by track and by scan, (clusters, columns).

    `spread` is how much wider sums over tracks scatter when errors of those nearby are alike, `drift` sums over scans
    when errors of those that follow are; `expected` how many strays a weak form adds to each track and scan.
    """

    direction: Direction
    quantity: Quantity | Literal["likelihood"]
    track: np.ndarray
    scan: np.ndarray
    information: float
    track_information: np.ndarray
    scan_information: np.ndarray
    spread: float = 1.0
    drift: float = 1.0
    expected: tuple[np.ndarray, ...] = ()


def run_gate(
    directions: Sequence[Direction],
    evidence: Sequence[Evidence],
    raw: Sequence[Evidence],
    clusters: Clusters,
    present: Sequence[Column],
    poses: SparseMatrix,
    rng: np.random.Generator,
    posed: Sequence[Posed] = (),
) -> Verdict:
    """Test all directions at once.

    Args:
        directions: to look in.
        evidence: with the pose errors of every scan fitted; fine, then coarse views of ranges.
        raw: the same with poses taken as they are said: for what cannot be told from a pose error in one scan.
        clusters: of beams.
        present: columns of parameters that have been fitted.
        poses: (n, 6·scans) columns of pose errors; (n, 0) where there are none.
        rng: for the signs.
        posed: what fitted pose errors say.
    """
    sums: list[Sums] = []
    with_pose = [_Projector(present, one, poses, clusters, clusters.part) for one in evidence]
    without = [_Projector(present, one, None, clusters, clusters.scan) for one in raw]
    for direction in directions:
        if direction.gain is not None:
            sums.append(_gained(direction, direction.gain, clusters))
        for quantity in direction.column.delta:
            if quantity not in evidence[0].score:
                continue
            if quantity != "range" or not raw:
                sums += with_pose[0].sums(direction, quantity, 0.0)
                continue
            for projector in with_pose if poses.shape[1] else ():
                sums += projector.sums(direction, quantity, _KEPT_SHARE)
            for projector in without:
                sums += [_drifting(one) for one in projector.sums(direction, quantity, 0.0)]
    if not sums:
        return Verdict((), 1.0)
    values, p_values, critical = _tested(sums, rng, posed)
    found = []
    for one, value, p in zip(sums, values[: len(sums)], p_values[: len(sums)], strict=True):
        # Of a group of rings the same amplitude in all is meant.
        smallest = smallest_amplitude(one, critical + Z80) if one.direction.amplitude else np.nan
        found.append(Statistic(one.direction, one.quantity, float(value), float(p), float(smallest)))
    for one, value, p in zip(posed, values[len(sums) :], p_values[len(sums) :], strict=True):
        smallest = (critical + Z80) * one.error
        found.append(Statistic(one.direction, "poses", float(value), max(float(p), one.p_value), smallest))
    found.sort(key=lambda one: -one.value)
    return Verdict(tuple(found), min(one.p_value for one in found))


class _Projector:
    """Sums scores of columns by cluster, with what present parameters and poses explain taken out of the columns."""

    def __init__(
        self,
        present: Sequence[Column],
        evidence: Evidence,
        poses: SparseMatrix | None,
        clusters: Clusters,
        scan: np.ndarray,
    ) -> None:
        self._evidence = evidence
        self._present = present
        self._poses = poses
        self._clusters, self._near = [_one_hot(clusters.track), _one_hot(scan)], clusters.near
        self._cache: dict[Quantity, tuple[SparseMatrix, np.ndarray, list[np.ndarray]]] = {}

    def sums(self, direction: Direction, quantity: Quantity, kept_share: float) -> list[Sums]:
        """At most one: none where too little of the column is left."""
        rows = len(self._evidence.score[quantity])
        column = direction.column.matrix(quantity, rows)
        score, information = self._evidence.score[quantity], self._evidence.information[quantity]
        weighted: SparseMatrix = sparse.diags(information) @ column
        scored: SparseMatrix = sparse.diags(score) @ column
        total = float((column.multiply(weighted)).sum())
        if total <= 0:
            return []
        by_cluster = [(one @ scored).toarray() for one in self._clusters]
        basis, inverse, scores = self._basis(quantity, rows)
        left = total
        if basis.shape[1]:
            shared = (basis.T @ weighted).toarray()
            explained = inverse @ shared
            left = total - float((shared * explained).sum())
            by_cluster = [found - of_basis @ explained for found, of_basis in zip(by_cluster, scores, strict=True)]
        if left < max(kept_share, 1e-4) * total:
            return []
        square = column.multiply(weighted).tocsr()
        known = [(one @ square).toarray() for one in self._clusters]
        by_track, by_scan = (_bounded(*pair) for pair in zip(by_cluster, known, strict=True))
        of_track, of_scan = (one.sum(1) for one in known)
        spread = widened(by_track, of_track, self._near)
        return [Sums(direction, quantity, by_track, by_scan, left, of_track, of_scan, spread)]

    def _basis(self, quantity: Quantity, rows: int) -> tuple[SparseMatrix, np.ndarray, list[np.ndarray]]:
        """What is there already changes of a quantity; its inverse information, and its scores by cluster.

        Where a laser looks is told by ranges and by rises. So scores and information are those of both: a column of
        ranges alone must not be taken for a laser's elevation that its rises deny.
        """
        if quantity not in self._cache:
            together: tuple[Quantity, ...] = _OF_WHERE if quantity in _OF_WHERE else (quantity,)
            of_each: dict[Quantity, SparseMatrix] = {
                one: self._columns(one, rows) for one in together if one in self._evidence.score
            }
            keep = np.flatnonzero(np.asarray(abs(of_each[quantity]).sum(0)).ravel() > 0)
            matrix = np.zeros((len(keep), len(keep)))
            scores = [np.zeros((hot.shape[0], len(keep))) for hot in self._clusters]
            for one, columns in of_each.items():
                kept = columns[:, keep]
                matrix += (kept.T @ sparse.diags(self._evidence.information[one]) @ kept).toarray()
                weighted: SparseMatrix = sparse.diags(self._evidence.score[one]) @ kept
                scores = [found + (hot @ weighted).toarray() for found, hot in zip(scores, self._clusters, strict=True)]
            matrix += np.diag(1e-9 * np.diag(matrix) + 1e-12)
            inverse = np.linalg.inv(matrix) if len(matrix) else matrix
            self._cache[quantity] = (of_each[quantity][:, keep], inverse, scores)
        return self._cache[quantity]

    def _columns(self, quantity: Quantity, rows: int) -> SparseMatrix:
        parts = [column.matrix(quantity, rows) for column in self._present]
        if self._poses is not None:
            parts.append(self._poses if quantity == "range" else sparse.csr_matrix(self._poses.shape))
        return sparse.hstack(parts, format="csr") if parts else sparse.csr_matrix((rows, 0))


def _tested(
    sums: Sequence[Sums], rng: np.random.Generator, posed: Sequence[Posed] = ()
) -> tuple[np.ndarray, np.ndarray, float]:
    """Equivalent normal deviates, family-wise p-values, and the deviate that p = 0.05 takes.

    Of sums first, then of pose errors, which are drawn as normal ones.
    """
    by_pose = _posed_deviates(posed, rng)
    one_sided = np.array([one.quantity == "likelihood" or one.direction.one_sided for one in sums])
    return family_wise(
        (
            ([one.track for one in sums], np.array([one.spread for one in sums])),
            ([one.scan for one in sums], np.array([one.drift for one in sums])),
        ),
        one_sided,
        by_pose,
        rng,
    )


def _posed_deviates(posed: Sequence[Posed], rng: np.random.Generator) -> np.ndarray:
    """(1 + draws, candidates): the true ones, then of normal pose errors; below 0 of a sign that makes no sense."""
    if not posed:
        return np.zeros((1 + DRAWS, 0))
    units = np.stack([one.unit for one in posed], 1)
    z = np.vstack([[one.deviate for one in posed], rng.standard_normal((DRAWS, len(units))) @ units])
    return np.where([one.direction.one_sided for one in posed], z, np.abs(z))


def _gained(direction: Direction, gain: np.ndarray, clusters: Clusters) -> Sums:
    """Gains by cluster, large ones as their logarithms: a single ghost of many beams must not drown all others.

    An odd function of sums whose signs are random leaves their signs random.
    """
    both = (clusters.track, clusters.part)
    by_track, by_scan = (compressed(np.bincount(cluster, gain))[:, None] for cluster in both)
    acts, expected = (by_track[:, 0] != 0).astype(float), ()  # where an effect does nothing, nothing is expected of it
    if direction.strays is not None:
        expected = tuple(np.bincount(cluster, direction.strays.expected) for cluster in both)
        acts = expected[0]
    spread = widened(by_track, acts, clusters.near)
    size = float(gain @ gain)
    both = by_track[:, 0], by_scan[:, 0]
    return Sums(direction, "likelihood", by_track, by_scan, size, *both, spread, expected=expected)


def _bounded(score: np.ndarray, information: np.ndarray) -> np.ndarray:
    """Scores by cluster, beyond some standard deviations only growing as their logarithms.

    Where an effect is plain, few objects that have most of the beams must not outvote that all others agree.
    """
    sigma = np.sqrt(np.maximum(information, 1e-300))
    beyond = np.maximum(np.abs(score) / (_PLAIN * sigma), 1.0)
    return score / beyond * (1 + np.log(beyond))


def _drifting(sums: Sums) -> Sums:
    """With the drift that the sums themselves show (first-order autoregression)."""
    # What a constant amplitude leaves unexplained in every scan.
    apart = sums.scan - np.outer(sums.scan_information / sums.scan_information.sum(), sums.scan.sum(0))
    square = float((apart**2).sum())
    if len(apart) < _FEWEST_SCANS or square <= 0:
        return sums
    likeness = float(np.clip((apart[1:] * apart[:-1]).sum() / square, 0.0, _MOST_LIKE))
    return replace(sums, drift=float(np.sqrt((1 + likeness) / (1 - likeness))))


def _one_hot(cluster: np.ndarray) -> SparseMatrix:
    rows = len(cluster)
    return sparse.csr_matrix((np.ones(rows), (cluster, np.arange(rows))), (int(cluster.max(initial=-1)) + 1, rows))
