"""What residuals say about a change of the prediction, channel by channel.

For a change Δ of a predicted quantity (mean range, log spread, probability …) a beam contributes `score`·Δ to the
slope of the log-likelihood and `information`·Δ² to its curvature.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy import linalg, sparse

from cosim.discrepancy.inference.likelihood import (
    MEAN_INFORMATION,
    Residuals,
    intensity_spread,
    range_spread_m,
    student_score,
)
from cosim.discrepancy.sampling.sample import Prediction, Sample
from cosim.discrepancy.settings import Law

Quantity = Literal[
    "range", "rise", "intensity", "range_variance", "intensity_variance", "drop", "spurious", "early", "late"
]
QUANTITIES: tuple[Quantity, ...] = (
    "range", "rise", "intensity", "range_variance", "intensity_variance", "drop", "spurious", "early", "late"
)  # fmt: skip
_SPREAD_INFORMATION = 2.0  # of a Gaussian: of d log σ, E[(z² − 1)²]; and E[z² − 1] grows by 2 a unit of it


@dataclass(frozen=True, eq=False)
class Evidence:
    """Scores and informations of n beams, by quantity."""

    score: dict[Quantity, np.ndarray]
    information: dict[Quantity, np.ndarray]

    @classmethod
    def of(
        cls, sample: Sample, residuals: Residuals, rise_blur: float = 0.0, wider: tuple[float, float] = (1.0, 1.0)
    ) -> Evidence:
        """The evidence in a fit; weighted so that beams of the sample stand for all.

        Args:
            sample, residuals: the measurements, and how a model fits them.
            rise_blur: a standard deviation [m] added to every rise.
            wider: by how much ranges and rises scatter more than is stated, see `dispersion`.
        """
        weight, law = sample.share, sample.settings.law
        matched, returned = weight * residuals.matched, weight * sample.returned
        range_z, range_sigma = residuals.range_z / wider[0], residuals.range_sigma_m * wider[0]
        rise_z, rise_sigma = residuals.rise_z / wider[1], np.hypot(law.rise_sigma_m, rise_blur) * wider[1]
        variance = residuals.seen * (1 - residuals.seen)
        possible = variance > 0
        pair = np.maximum(sample.partner, 0)
        paired = weight * residuals.matched * residuals.matched[pair] * (sample.partner >= 0)
        range_gap = (residuals.range_z - residuals.range_z[pair]) / np.sqrt(2)
        intensity_gap = (residuals.intensity_z - residuals.intensity_z[pair]) / np.sqrt(2)
        lost = residuals.met * ~sample.returned[sample.own]
        binary = np.where(possible, weight / np.where(possible, variance, 1), 0.0)
        score: dict[Quantity, np.ndarray] = {
            "range": matched * student_score(range_z) / range_sigma,
            "rise": returned * student_score(rise_z) / rise_sigma,
            "range_variance": paired * _spread_excess(range_gap, law),
            "drop": binary * ((1 - residuals.expected_seen) * residuals.matched - residuals.expected_seen * lost),
        }
        information: dict[Quantity, np.ndarray] = {
            "range": matched * MEAN_INFORMATION / range_sigma**2,
            "rise": returned * MEAN_INFORMATION / rise_sigma**2,
            "range_variance": paired * _SPREAD_INFORMATION,
            "drop": binary * residuals.met,
        }
        if sample.has_intensity:
            bright = weight * residuals.bright
            plain = residuals.bright * residuals.whole * ~sample.seam
            lit = weight * plain * plain[pair] * (sample.partner >= 0)
            score["intensity"] = bright * residuals.intensity_score / residuals.intensity_sigma
            information["intensity"] = bright * residuals.intensity_known / residuals.intensity_sigma**2
            score["intensity_variance"] = lit * _spread_excess(intensity_gap, law)
            information["intensity_variance"] = lit * _SPREAD_INFORMATION
        return cls(score, information)

    def reweighted(self, residuals: Residuals, law: Law) -> Evidence:
        """With the curvature of ranges far off that their score has (iterated reweighting of a Student-t).

        On average over noise curvatures are as they are said; beams that are far off would hold a step back by the
        curvature of beams that fit, though they hardly count at all.
        """
        far = np.abs(residuals.range_z) > law.far_off
        residual = np.where(far, residuals.range_z, 1.0) * residuals.range_sigma_m
        loose = np.where(far, self.score["range"] / residual, self.information["range"])
        information: dict[Quantity, np.ndarray] = {**self.information, "range": loose}
        return Evidence(self.score, information)


def change(before: Prediction, after: Prediction, law: Law) -> dict[Quantity, np.ndarray]:
    """How a prediction changes, (n,) by quantity; quantities that stay are left out."""
    both = np.isfinite(before.range_m) & np.isfinite(after.range_m)
    # A change of reported centre moves points along and across; what was measured stays.
    found: dict[Quantity, np.ndarray] = {
        "range": np.where(both, after.range_m - before.range_m, 0.0),
        "rise": np.nan_to_num(after.rise_m - before.rise_m),
        "intensity": after.intensity - before.intensity,
        "range_variance": np.log(range_spread_m(after, law) / range_spread_m(before, law)),
        "intensity_variance": np.log(intensity_spread(after, law) / intensity_spread(before, law)),
        "drop": after.seen - before.seen,
    }
    return {name: values for name, values in found.items() if np.any(np.abs(values) > 1e-12)}


def dispersion(sample: Sample, residuals: Residuals) -> tuple[float, float]:
    """By how much ranges and rises scatter more than is stated, at least 1 (McCullagh and Nelder 1989, § 9.2).

    Heavy tails hardly count where everything is far off; beside the scatter that there is, it does. The median of the
    residuals' sizes tells of it.
    """

    def of(z: np.ndarray, weight: np.ndarray) -> float:
        used = weight > 0
        if not used.any():
            return 1.0
        size, share = np.abs(z[used]), weight[used]
        order = np.argsort(size)
        below = np.cumsum(share[order])
        return max(float(size[order][np.searchsorted(below, 0.5 * below[-1])]) / sample.settings.law.median_size, 1.0)

    return of(residuals.range_z, sample.share * residuals.matched), of(residuals.rise_z, sample.share * sample.returned)


def _spread_excess(gap: np.ndarray, law: Law) -> np.ndarray:
    """Above 0 where neighbours scatter more than stated, 0 on average for any law of the stated standard deviation."""
    return np.minimum(gap**2, law.most_squared) - 1


SparseMatrix = Any  # scipy's sparse matrices; their types do not tell what products give


@dataclass(frozen=True, eq=False)
class Column:
    """The change of a prediction per unit of a parameter, or of several with `ring` or `basis`.

    Attributes:
        delta: (n,) by quantity.
        ring: (n,) int which parameter each beam depends on, for one parameter per ring; else None.
        rings: number of parameters.
        basis: (n, rings) basis functions that multiply `delta`, for coefficients of a dependence; else None.
    """

    delta: dict[Quantity, np.ndarray]
    ring: np.ndarray | None = None
    rings: int = 1
    basis: SparseMatrix | None = None

    def matrix(self, quantity: Quantity, rows: int) -> SparseMatrix:
        """(n, rings) of one quantity."""
        values = self.delta.get(quantity)
        if values is None:
            return sparse.csr_matrix((rows, self.rings))
        if self.basis is not None:
            return scaled(self.basis, values)
        used = np.nonzero(values)[0]
        place = np.zeros(len(used), int) if self.ring is None else self.ring[used]
        return sparse.csr_matrix((values[used], (used, place)), (rows, self.rings))


class Factored:
    """Factorisation of a symmetric positive definite matrix that has many small independent blocks.

    Rows of different blocks share nothing with each other, so that the blocks are inverted one by one and eliminated;
    the Schur complement of the other rows is factored as a dense matrix.

    Args:
        matrix: (a, a).
        block: (a,) int block that each row belongs to; −1 for rows of none.
    """

    def __init__(self, matrix: SparseMatrix, block: np.ndarray) -> None:
        matrix = matrix.tocsr()
        self._apart, self._rest = np.flatnonzero(block >= 0), np.flatnonzero(block < 0)
        self._across = matrix[self._rest][:, self._apart]
        self._inverse, self._log_blocks = _inverse_blocks(matrix[self._apart][:, self._apart], block[self._apart])
        rest = matrix[self._rest][:, self._rest]
        if len(self._apart):
            rest = rest - self._across @ self._inverse @ self._across.T
        self._factor = linalg.cho_factor(np.asarray(rest.todense()), lower=True) if len(self._rest) else None

    def solve(self, right: np.ndarray) -> np.ndarray:
        """The solution (a, …) of a right-hand side."""
        found, of_apart = np.zeros_like(right), right[self._apart]
        if self._factor is not None:
            left = right[self._rest] - self._across @ (self._inverse @ of_apart)
            found[self._rest] = linalg.cho_solve(self._factor, left, check_finite=False)
            of_apart = of_apart - self._across.T @ found[self._rest]
        found[self._apart] = self._inverse @ of_apart
        return found

    def log_determinant(self) -> float:
        """Of the matrix."""
        rest = 0.0 if self._factor is None else 2 * float(np.log(np.diag(self._factor[0])).sum())
        return rest + self._log_blocks


def _inverse_blocks(matrix: SparseMatrix, block: np.ndarray) -> tuple[SparseMatrix, float]:
    """The inverse of a block-diagonal matrix (a, a), and the logarithm of its determinant."""
    number = np.unique(block, return_inverse=True)[1] if len(block) else block
    order = np.argsort(number, kind="stable")
    count = np.bincount(number)
    first = np.cumsum(count) - count
    place = np.empty(len(block), int)  # of each row within its block
    place[order] = np.arange(len(block)) - np.repeat(first, count)
    entries, parts, log_determinant = matrix.tocoo(), list[np.ndarray](), 0.0
    for size in np.unique(count):
        blocks = np.flatnonzero(count == size)
        row_of = np.full(len(count), -1)
        row_of[blocks] = np.arange(len(blocks))
        dense = np.zeros((len(blocks), size, size))
        mine = row_of[number[entries.row]] >= 0
        row, column = entries.row[mine], entries.col[mine]
        np.add.at(dense, (row_of[number[row]], place[row], place[column]), entries.data[mine])
        rows = order[first[blocks][:, None] + np.arange(size)]  # (blocks, size)
        left, right = np.broadcast_arrays(rows[:, :, None], rows[:, None, :])
        parts.append(np.stack([left.ravel(), right.ravel(), np.linalg.inv(dense).ravel()]))
        log_determinant += float(np.linalg.slogdet(dense)[1].sum())
    if not parts:
        return matrix, 0.0
    rows, columns, values = np.concatenate(parts, axis=1)
    inverse = sparse.csr_matrix((values, (rows.astype(int), columns.astype(int))), matrix.shape)
    return inverse, log_determinant


def stacked(columns: Sequence[Column], quantities: Collection[Quantity], rows: int) -> dict[Quantity, SparseMatrix]:
    """Matrices (n, p) of the quantities among `quantities` that any column changes; of one where none changes any."""
    found: dict[Quantity, SparseMatrix] = {}
    for quantity in QUANTITIES:
        changed = any(quantity in column.delta for column in columns)
        if quantity in quantities and (changed or (columns and not found and quantity == "drop")):
            found[quantity] = sparse.hstack([column.matrix(quantity, rows) for column in columns], format="csr")
    return found


def summed_by(cluster: np.ndarray, matrix: SparseMatrix, weight: np.ndarray, clusters: int) -> np.ndarray:
    """Weighted rows of a compressed sparse matrix (n, k), summed by cluster: (clusters, k)."""
    rows, places = _rows(matrix), _places(matrix)
    width = matrix.shape[1]
    sums = np.bincount(cluster[rows] * width + places, matrix.data * weight[rows], clusters * width)
    return sums.reshape(clusters, width)


def scaled(matrix: SparseMatrix, weight: np.ndarray) -> SparseMatrix:
    """A compressed sparse matrix (n, k) with its rows multiplied by weights (n,)."""
    found = matrix.copy()
    found.data = found.data * weight[_rows(matrix)]
    return found


def ridged(matrix: np.ndarray, share: float = 1e-9, least: float = 1e-12) -> np.ndarray:
    """A symmetric matrix with a little more on its diagonal, so that it can be inverted."""
    return matrix + np.diag(share * np.diag(matrix) + least)


def _rows(matrix: SparseMatrix) -> np.ndarray:
    return matrix.indices if matrix.format == "csc" else np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))


def _places(matrix: SparseMatrix) -> np.ndarray:
    return matrix.indices if matrix.format == "csr" else np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
