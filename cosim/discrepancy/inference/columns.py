"""Columns of parameters: how a prediction changes with each, and the matrices that they make."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg, sparse

from cosim.discrepancy.inference.score import QUANTITIES, Quantity

SparseMatrix = Any  # scipy's sparse matrices; their types do not tell what products give


@dataclass(frozen=True, eq=False)
class Column:
    """The change that a unit of a parameter makes; with `ring` it is one parameter a ring.

    Attributes:
        delta: (n,) by quantity.
        ring: (n,) int, or None.
        rings: number of parameters, 1 without rings.
    """

    delta: dict[Quantity, np.ndarray]
    ring: np.ndarray | None = None
    rings: int = 1

    def matrix(self, quantity: Quantity, rows: int) -> SparseMatrix:
        """(n, rings) of one quantity."""
        values = self.delta.get(quantity)
        if values is None:
            return sparse.csr_matrix((rows, self.rings))
        used = np.nonzero(values)[0]
        place = np.zeros(len(used), int) if self.ring is None else self.ring[used]
        return sparse.csr_matrix((values[used], (used, place)), (rows, self.rings))


class Factored:
    """A symmetric positive definite matrix, many of whose rows share nothing with each other, factored.

    Args:
        matrix: (a, a).
        apart: (a,) bool: rows of which no two share anything; they are eliminated first.
    """

    def __init__(self, matrix: SparseMatrix, apart: np.ndarray) -> None:
        matrix = matrix.tocsr()
        self._apart, self._rest = np.flatnonzero(apart), np.flatnonzero(~apart)
        self._diagonal = matrix.diagonal()[self._apart]
        self._across = matrix[self._rest][:, self._apart]
        rest = matrix[self._rest][:, self._rest]
        if len(self._apart):
            rest = rest - self._across @ sparse.diags(1 / self._diagonal) @ self._across.T
        self._factor = linalg.cho_factor(np.asarray(rest.todense()), lower=True) if len(self._rest) else None

    def solve(self, right: np.ndarray) -> np.ndarray:
        """The solution (a, …) of a right-hand side."""
        found, of_apart = np.zeros_like(right), right[self._apart]
        diagonal = self._diagonal.reshape((-1,) + (1,) * (right.ndim - 1))
        if self._factor is not None:
            left = right[self._rest] - self._across @ (of_apart / diagonal)
            found[self._rest] = linalg.cho_solve(self._factor, left, check_finite=False)
            of_apart = of_apart - self._across.T @ found[self._rest]
        found[self._apart] = of_apart / diagonal
        return found

    def log_determinant(self) -> float:
        """Of the matrix."""
        rest = 0.0 if self._factor is None else 2 * float(np.log(np.diag(self._factor[0])).sum())
        return rest + float(np.log(self._diagonal).sum())


def stacked(columns: Sequence[Column], quantities: Collection[Quantity], rows: int) -> dict[Quantity, SparseMatrix]:
    """Matrices (n, p) of the quantities among `quantities` that any column changes; of one where none changes any."""
    found: dict[Quantity, SparseMatrix] = {}
    for quantity in QUANTITIES:
        changed = any(quantity in column.delta for column in columns)
        if quantity in quantities and (changed or (columns and not found and quantity == QUANTITIES[-1])):
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
