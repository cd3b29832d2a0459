"""Linearised model of a sample: columns of parameters, pose errors of every scan, and the normal equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from cosim.discrepancy.inference.score import QUANTITIES, ROUNDED_M, Evidence, Quantity

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

    def resolved(self, quantity: str) -> float:
        """Amplitude below which points do not leave the grid of what is stored: of the component across beams alone."""
        if quantity != "rise":
            return 0.0
        size = np.abs(self.delta["rise"])
        return ROUNDED_M / float(np.median(size[size > 0])) if size.any() else 0.0

    def matrix(self, quantity: Quantity, rows: int) -> SparseMatrix:
        """(n, rings) of one quantity."""
        values = self.delta.get(quantity)
        if values is None:
            return sparse.csr_matrix((rows, self.rings))
        used = np.nonzero(values)[0]
        place = np.zeros(len(used), int) if self.ring is None else self.ring[used]
        return sparse.csr_matrix((values[used], (used, place)), (rows, self.rings))


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations A·step = b over parameters, then pose errors."""

    matrix: np.ndarray
    right: np.ndarray
    parameters: int

    @classmethod
    def of(cls, columns: Sequence[Column], evidence: Evidence, poses: SparseMatrix | None) -> Normal:
        """Built from columns and evidence; without `poses` scans have no pose errors."""
        count = sum(column.rings for column in columns)
        extra = 0 if poses is None else poses.shape[1]
        matrix, right = np.zeros((count + extra, count + extra)), np.zeros(count + extra)
        for quantity in QUANTITIES:
            if quantity not in evidence.score:
                continue
            rows = len(evidence.score[quantity])
            parts = [column.matrix(quantity, rows) for column in columns]
            if poses is not None:
                parts.append(poses if quantity == "range" else sparse.csr_matrix((rows, extra)))
            if not parts:
                continue
            joined = sparse.hstack(parts, format="csr")
            if not joined.nnz:
                continue
            weighted = sparse.diags(evidence.information[quantity]) @ joined
            matrix += (joined.T @ weighted).toarray()
            right += joined.T @ evidence.score[quantity]
        return cls(matrix, right, count)
