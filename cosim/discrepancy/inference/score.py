"""Scores and Fisher information of the beams by predicted quantity, and the linear algebra on them.

For a change Δ of a predicted quantity (mean range, log σ, probability …) a beam contributes `score`·Δ to the first
order change of the log-likelihood and −½ `information`·Δ² to the second.
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
    noise_slope,
    student_score,
    unshared_spread_m,
)
from cosim.discrepancy.sampling.sample import Prediction, Sample
from cosim.discrepancy.settings import LikelihoodConstants

Quantity = Literal[
    "range", "rise", "intensity", "range_variance", "intensity_variance", "drop", "spurious", "early", "late"
]
QUANTITIES: tuple[Quantity, ...] = (
    "range", "rise", "intensity", "range_variance", "intensity_variance", "drop", "spurious", "early", "late"
)  # fmt: skip
_ROUNDING = 1e-5  # of the logarithm of single-precision σ
_SPREAD_INFORMATION = 2.0  # Gaussian information about log σ: E[(z² − 1)²] = 2; d E[z² − 1]/d log σ = 2


@dataclass(frozen=True, eq=False)
class Evidence:
    """Scores and informations (n,) of n beams, by quantity (per unit of the quantity: m, m, 1, log σ, probability)."""

    score: dict[Quantity, np.ndarray]
    information: dict[Quantity, np.ndarray]

    @classmethod
    def of(
        cls, sample: Sample, residuals: Residuals, rise_blur: float = 0.0, wider: tuple[float, float] = (1.0, 1.0)
    ) -> Evidence:
        """Compute scores and informations at a fit, weighted by the inverse sampling probability (mean weight 1).

        Args:
            sample, residuals: sample of measured beams and their residuals.
            rise_blur: standard deviation [m] added to all rises.
            wider: factors on the stated σ of ranges and rises, see `dispersion`.
        """
        weight, constants = sample.share, sample.settings.likelihood
        matched, returned = weight * residuals.matched, weight * sample.returned
        range_z, range_sigma = residuals.range_z / wider[0], residuals.range_sigma_m * wider[0]
        rise_z, rise_sigma = residuals.rise_z / wider[1], np.hypot(constants.rise_sigma_m, rise_blur) * wider[1]
        seen, silent = residuals.expected_seen, residuals.expected_silent
        possible = residuals.seen > 0
        pair = np.maximum(sample.partner, 0)
        paired = weight * residuals.matched * residuals.matched[pair] * (sample.partner >= 0)
        unshared_z = residuals.range_z * residuals.range_sigma_m / residuals.unshared_sigma_m
        range_gap = (unshared_z - unshared_z[pair]) / np.sqrt(2)
        intensity_gap = (residuals.intensity_z - residuals.intensity_z[pair]) / np.sqrt(2)
        is_lost = residuals.met * ~sample.returned[sample.own]
        # The outcome is a return of the surface or nothing; other returns say nothing about how often it is lost.
        possible_weight = np.where(possible, weight * residuals.not_missed, 0.0)
        binary = possible_weight / np.where(possible, residuals.seen * residuals.silent, 1)
        score: dict[Quantity, np.ndarray] = {
            "range": matched * student_score(range_z) / range_sigma,
            "rise": returned * student_score(rise_z) / rise_sigma,
            "range_variance": paired * spread_excess(range_gap, constants),
            "drop": binary * (silent * residuals.matched - seen * is_lost),
        }
        information: dict[Quantity, np.ndarray] = {
            "range": matched * MEAN_INFORMATION / range_sigma**2,
            "rise": returned * MEAN_INFORMATION / rise_sigma**2,
            "range_variance": paired * _SPREAD_INFORMATION,
            "drop": binary * residuals.met * (seen + silent),
        }
        if sample.has_intensity:
            bright = weight * residuals.bright
            uncensored = residuals.bright * residuals.whole * ~sample.seam
            paired_intensity = weight * uncensored * uncensored[pair] * (sample.partner >= 0)
            score["intensity"] = bright * residuals.intensity_score / residuals.intensity_sigma
            information["intensity"] = bright * residuals.intensity_information / residuals.intensity_sigma**2
            score["intensity_variance"] = paired_intensity * spread_excess(intensity_gap, constants)
            information["intensity_variance"] = paired_intensity * _SPREAD_INFORMATION
        return cls(score, information)

    def reweighted(self, residuals: Residuals, constants: LikelihoodConstants) -> Evidence:
        """Replace the information of outliers by score/residual (iteratively reweighted least squares).

        The expected information of a Student-t is too large for outliers, which have almost no influence; with it
        steps would be too short.
        """
        information = dict(self.information)
        pairs: tuple[tuple[Quantity, np.ndarray], ...] = (
            ("range", residuals.range_z), ("intensity", residuals.intensity_z)
        )  # fmt: skip
        for name, z in pairs:
            if name in information:
                outlying = np.maximum(np.abs(z), constants.far_off)
                share = student_score(outlying) / outlying / MEAN_INFORMATION
                information[name] = np.where(np.abs(z) > constants.far_off, share, 1.0) * information[name]
        return Evidence(self.score, information)


def change(sample: Sample, before: Prediction, after: Prediction) -> dict[Quantity, np.ndarray]:
    """Difference (n,) of two predictions by quantity; quantities that do not change are omitted.

    On a map that was made from the scans, the score of the intensity includes noise in proportion to it.
    """
    constants = sample.settings.likelihood
    both = np.isfinite(before.range_m) & np.isfinite(after.range_m)
    # A change of the reported optical centre moves points along and across the beam; measurements are unchanged.
    differences: dict[Quantity, np.ndarray] = {
        "range": np.where(both, after.range_m - before.range_m, 0.0),
        "rise": np.nan_to_num(after.rise_m - before.rise_m),
        "intensity": after.intensity - before.intensity,
        "range_variance": np.log(unshared_spread_m(after, constants) / unshared_spread_m(before, constants)),
        "intensity_variance": np.log(intensity_spread(after, constants) / intensity_spread(before, constants)),
        "drop": after.seen - before.seen,
    }
    if sample.of_own_map:
        beyond = differences["intensity_variance"] - noise_slope(before, constants) * differences["intensity"]
        differences["intensity_variance"] = np.where(np.abs(beyond) > _ROUNDING, beyond, 0.0)
    return {name: values for name, values in differences.items() if np.any(np.abs(values) > 1e-12)}


def dispersion(sample: Sample, residuals: Residuals) -> tuple[float, float]:
    """Dispersion factors of ranges and rises: measured over stated σ, at least 1 (McCullagh and Nelder 1989, § 9.2).

    Estimated robustly from the median of absolute residuals.
    """

    def of(z: np.ndarray, weight: np.ndarray) -> float:
        used = weight > 0
        if not used.any():
            return 1.0
        size, share = np.abs(z[used]), weight[used]
        order = np.argsort(size)
        below = np.cumsum(share[order])
        return max(
            float(size[order][np.searchsorted(below, 0.5 * below[-1])]) / sample.settings.likelihood.median_size, 1.0
        )

    return of(residuals.range_z, sample.share * residuals.matched), of(residuals.rise_z, sample.share * sample.returned)


def spread_excess(gap: np.ndarray, constants: LikelihoodConstants) -> np.ndarray:
    """min(gap², cap) − 1: 0 on average if differences of neighbours have the stated σ, above 0 if they scatter more."""
    return np.minimum(gap**2, constants.most_squared) - 1


SparseMatrix = Any  # a scipy.sparse matrix; scipy's types do not describe the results of products


@dataclass(frozen=True, eq=False)
class Column:
    """Derivative of a prediction with respect to one parameter, or to several (`ring` or `basis`).

    Attributes:
        delta: (n,) derivative by quantity.
        ring: (n,) int index of the parameter that each beam depends on, for one parameter per ring; else None.
        rings: number of parameters.
        basis: (n, rings) basis functions that multiply `delta`, for coefficients of a dependence; else None.
    """

    delta: dict[Quantity, np.ndarray]
    ring: np.ndarray | None = None
    rings: int = 1
    basis: SparseMatrix | None = None

    def matrix(self, quantity: Quantity, rows: int) -> SparseMatrix:
        """Sparse derivative (n, rings) of one quantity."""
        values = self.delta.get(quantity)
        if values is None:
            return sparse.csr_matrix((rows, self.rings))
        if self.basis is not None:
            return scaled(self.basis, values)
        used = np.nonzero(values)[0]
        index = np.zeros(len(used), int) if self.ring is None else self.ring[used]
        return sparse.csr_matrix((values[used], (used, index)), (rows, self.rings))


class Factored:
    """Factorisation of a symmetric positive definite matrix that has many small independent blocks.

    Entries between rows of different blocks are 0, so that the blocks are inverted one by one and eliminated; the Schur
    complement of the other rows is factored as a dense matrix (Cholesky).

    Args:
        matrix: (a, a).
        block: (a,) int block of each row; −1 for rows outside all blocks.
    """

    def __init__(self, matrix: SparseMatrix, block: np.ndarray) -> None:
        matrix = matrix.tocsr()
        self._blocked, self._rest = np.flatnonzero(block >= 0), np.flatnonzero(block < 0)
        self._across = matrix[self._rest][:, self._blocked]
        self._inverse, self._log_blocks = _inverse_blocks(matrix[self._blocked][:, self._blocked], block[self._blocked])
        rest = matrix[self._rest][:, self._rest]
        if len(self._blocked):
            rest = rest - self._across @ self._inverse @ self._across.T
        self._factor = linalg.cho_factor(np.asarray(rest.todense()), lower=True) if len(self._rest) else None

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for a right-hand side (a, …)."""
        solution, of_blocked = np.zeros_like(right), right[self._blocked]
        if self._factor is not None:
            left = right[self._rest] - self._across @ (self._inverse @ of_blocked)
            solution[self._rest] = linalg.cho_solve(self._factor, left, check_finite=False)
            of_blocked = of_blocked - self._across.T @ solution[self._rest]
        solution[self._blocked] = self._inverse @ of_blocked
        return solution

    def log_determinant(self) -> float:
        """Logarithm of the determinant of the matrix."""
        rest = 0.0 if self._factor is None else 2 * float(np.log(np.diag(self._factor[0])).sum())
        return rest + self._log_blocks


def _inverse_blocks(matrix: SparseMatrix, block: np.ndarray) -> tuple[SparseMatrix, float]:
    """Invert a block-diagonal matrix (a, a); return the inverse and the logarithm of the determinant."""
    number = np.unique(block, return_inverse=True)[1] if len(block) else block
    order = np.argsort(number, kind="stable")
    count = np.bincount(number)
    first = np.cumsum(count) - count
    position = np.empty(len(block), int)  # of each row within its block
    position[order] = np.arange(len(block)) - np.repeat(first, count)
    entries, parts, log_determinant = matrix.tocoo(), list[np.ndarray](), 0.0
    for size in np.unique(count):
        blocks = np.flatnonzero(count == size)
        row_of = np.full(len(count), -1)
        row_of[blocks] = np.arange(len(blocks))
        dense = np.zeros((len(blocks), size, size))
        selected = row_of[number[entries.row]] >= 0
        row, column = entries.row[selected], entries.col[selected]
        np.add.at(dense, (row_of[number[row]], position[row], position[column]), entries.data[selected])
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
    """Stack columns to one matrix (n, p) for each of `quantities` that any column changes (at least one matrix)."""
    matrices: dict[Quantity, SparseMatrix] = {}
    for quantity in QUANTITIES:
        changed = any(quantity in column.delta for column in columns)
        if quantity in quantities and (changed or (columns and not matrices and quantity == "drop")):
            matrices[quantity] = sparse.hstack([column.matrix(quantity, rows) for column in columns], format="csr")
    return matrices


def side_by_side(parts: Sequence[SparseMatrix | None], widths: Sequence[int]) -> SparseMatrix:
    """Compressed sparse rows (n, w) of matrices next to each other; None for columns of zeros, but not for all."""
    there = [(part, first) for part, first in zip(parts, np.cumsum([0, *widths]), strict=False) if part is not None]
    rows, width = there[0][0].shape[0], sum(widths)
    if len(there) == 1:
        part, first = there[0]
        return sparse.csr_matrix((part.data, part.indices + first, part.indptr), (rows, width))
    pairs = zip(parts, widths, strict=True)
    return sparse.hstack([sparse.csr_matrix((rows, own)) if part is None else part for part, own in pairs], "csr")


def summed_by(cluster: np.ndarray, matrix: SparseMatrix, weight: np.ndarray, clusters: int) -> np.ndarray:
    """Sum the weighted rows of a compressed sparse matrix (n, k) by cluster; return (clusters, k)."""
    rows, columns = _row_indices(matrix), _column_indices(matrix)
    width = matrix.shape[1]
    sums = np.bincount(cluster[rows] * width + columns, matrix.data * weight[rows], clusters * width)
    return sums.reshape(clusters, width)


def scaled(matrix: SparseMatrix, weight: np.ndarray) -> SparseMatrix:
    """Multiply the rows of a compressed sparse matrix (n, k) by weights (n,)."""
    product = matrix.copy()
    product.data = product.data * weight[_row_indices(matrix)]
    return product


def ridged(matrix: np.ndarray, share: float = 1e-9, least: float = 1e-12) -> np.ndarray:
    """Add a small ridge to the diagonal of a symmetric matrix, so that it can be inverted."""
    return matrix + np.diag(share * np.diag(matrix) + least)


def _row_indices(matrix: SparseMatrix) -> np.ndarray:
    return matrix.indices if matrix.format == "csc" else np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))


def _column_indices(matrix: SparseMatrix) -> np.ndarray:
    return matrix.indices if matrix.format == "csr" else np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
