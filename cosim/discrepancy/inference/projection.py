"""Efficient scores of tested columns, summed by cluster.

With X the columns of a hypothesis, Z those of the random effects u of precision Λ and of all fitted parameters, and
A = (ZᵀWZ + Λ)⁻¹ZᵀWX, the efficient score is (X − ZA)ᵀs + AᵀΛû (Lindsey, Parametric Statistical Inference, § 3.6). The
first part is summed by the cluster of each beam, the second by the cluster that each random effect belongs to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.random_effects import Clusters, Estimate
from cosim.discrepancy.inference.score import Quantity, SparseMatrix, scaled, summed_by

TRACK, PART = 0, 1


@dataclass(frozen=True, eq=False)
class Projected:
    """Efficient scores of k columns.

    Attributes:
        tables: two arrays (clusters, k) of scores: by object track or map cell, and by part of a scan.
        known: two arrays (clusters, k) of information by cluster, in proportion to the information of the beams.
        information: (k, k) information with fitted parameters and random effects eliminated.
        whole: (k,) information if fitted parameters and random effects were known.
        floor: (k,) variance of the scores due to the sampling weights of the beams.
    """

    tables: tuple[np.ndarray, np.ndarray]
    known: tuple[np.ndarray, np.ndarray]
    information: np.ndarray
    whole: np.ndarray
    floor: np.ndarray

    @property
    def left(self) -> np.ndarray:
        """(k,) share of the information that remains after elimination of fitted parameters and random effects."""
        return np.clip(np.diag(self.information) / np.maximum(self.whole, 1e-300), 0, 1)


class Projector:
    """Computes efficient scores about one fitted model.

    Args:
        model: linear model about the fit, with random effects and fitted parameters.
        estimate: random effects of the fit.
        clusters: clusters of the beams and random effects.
        share: (n,) weights of the beams, 1 on average.
    """

    def __init__(self, model: LinearModel, estimate: Estimate, clusters: Clusters, share: np.ndarray) -> None:
        self._model, self._evidence, self._share = model, model.evidence, share
        self.clusters = (clusters.track, clusters.part)
        self._counts = tuple(int(cluster.max(initial=-1)) + 1 for cluster in self.clusters)
        self._of_fitted = [self._fitted_scores(*of) for of in zip(self.clusters, self._counts, strict=True)]
        prior = estimate.u[model.used] * model.precision
        track, scan = clusters.unit_track[model.used], clusters.unit_scan[model.used]
        (tracks, parts), scans = self._counts, int(clusters.scan.max(initial=-1)) + 1
        by_track = np.where(track >= 0, track, tracks + scan)
        by_part = np.where(track >= 0, parts + scans + track, parts + scan)
        at = np.arange(len(prior))
        self._prior: list[SparseMatrix] = [
            sparse.csr_matrix((prior, (by_track, at)), (tracks + scans, len(prior))),
            sparse.csr_matrix((prior, (by_part, at)), (parts + scans + tracks, len(prior))),
        ]

    def plain(self, basis: SparseMatrix, score: np.ndarray) -> list[np.ndarray]:
        """Scores (clusters, k) of basis functions (n, k) weighted by beam scores (n,), without elimination."""
        weighted = scaled(basis, score)
        tables = []
        for cluster, count in zip(self.clusters, self._counts, strict=True):
            indicator = sparse.csr_matrix((np.ones(len(cluster)), (cluster, np.arange(len(cluster)))))
            tables.append(np.asarray((indicator @ weighted).todense()).reshape(count, -1))
        return tables

    def project(self, columns: dict[Quantity, SparseMatrix]) -> Projected:
        """Efficient scores of columns (n, k) given by quantity."""
        coefficients, shared = self._model.projected(columns)
        information = -shared.T @ coefficients
        whole, floor = np.zeros(len(information)), np.zeros(len(information))
        known = tuple(np.zeros((table.shape[0], len(information))) for table in self._prior)
        for name, matrix in columns.items():
            weight = self._evidence.information[name]
            information = information + np.asarray((matrix.T @ scaled(matrix, weight)).todense())
            square = matrix.power(2)
            whole += square.T @ weight
            floor += square.T @ (weight * self._share)
            for table, cluster, count in zip(known, self.clusters, self._counts, strict=True):
                table[:count] += summed_by(cluster, square, weight, count)
        left = np.clip(np.diag(information) / np.maximum(whole, 1e-300), 0, 1)
        track, part = (table * left for table in known)
        tables = self._summed(columns, coefficients)
        return Projected(tables, (track, part), information, whole, floor * left)

    def _summed(self, columns: dict[Quantity, SparseMatrix], known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        tables = []
        for cluster, count, of_fitted, prior in zip(
            self.clusters, self._counts, self._of_fitted, self._prior, strict=True
        ):
            table = np.asarray(prior @ known[: prior.shape[1]])
            for name, matrix in columns.items():
                table[:count] += summed_by(cluster, matrix, self._evidence.score[name], count)
            table[:count] -= of_fitted @ known
            tables.append(table)
        return tables[TRACK], tables[PART]

    def _fitted_scores(self, cluster: np.ndarray, count: int) -> np.ndarray:
        """(clusters, a + p) scores of the columns of the random effects and of the fitted parameters."""
        parts = []
        for own, size in ((self._model.z, len(self._model.used)), (self._model.x, self._model.parameters)):
            scores = np.zeros((count, size))
            for name, matrix in own.items():
                if matrix.nnz:
                    scores += summed_by(cluster, matrix, self._evidence.score[name], count)
            parts.append(scores)
        return np.hstack(parts)
