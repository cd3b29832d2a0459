"""Efficient scores of tested columns, summed by cluster.

With X the columns of a hypothesis, Z those of the random effects u of precision Λ and of all fitted parameters, and
A = (ZᵀWZ + Λ)⁻¹ZᵀWX, the efficient score is (X − ZA)ᵀs + AᵀΛû (Lindsey, Parametric Statistical Inference, § 3.6). The
first part is summed by the cluster of each beam, the second by the cluster that each random effect belongs to.

A column may be a combination of the random effects' columns, X = ZA, up to rounding errors of its derivative: a mount
that is turned is a pose error that all scans share. Then only the second part, the random effects, informs about it,
and its information is AᵀΛA. See `random_stratum`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from cosim.discrepancy.inference.clusters import Clusters
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.random_effects import Estimate
from cosim.discrepancy.inference.random_stratum import RandomStratum
from cosim.discrepancy.inference.score import Quantity, SparseMatrix, scaled, summed_by

TRACK, PART = 0, 1
_ROUNDING = 1e-10  # share of a column's information that is a rounding error of linear algebra


@dataclass(frozen=True, eq=False)
class Projected:
    """Efficient scores of k columns.

    Attributes:
        tables: two arrays (clusters, k) of scores: by object track or map cell, and by part of a scan.
        cluster_information: two arrays (clusters, k) of information by cluster, in proportion to that of beams or of
            random effects.
        information: (k, k) information with fitted parameters and random effects eliminated.
        left: (k,) share of the information that remains after this elimination; 1 for combinations of random effects.
        floor: (k,) variance of the scores due to the sampling weights of the beams.
        random: (a, k) coefficients of the columns in a regression on the random effects' columns.
        is_of_random: (k,) whether columns are combinations of the random effects' columns.
    """

    tables: tuple[np.ndarray, np.ndarray]
    cluster_information: tuple[np.ndarray, np.ndarray]
    information: np.ndarray
    left: np.ndarray
    floor: np.ndarray
    random: np.ndarray
    is_of_random: np.ndarray


class Projector:
    """Computes efficient scores about one fitted model.

    Args:
        model: linear model about the fit, with random effects and fitted parameters.
        estimate: random effects of the fit.
        clusters: clusters of the beams and random effects.
        share: (n,) weights of the beams, 1 on average.
        least_left: share of a column's information below which it is a rounding error of its derivative.
    """

    def __init__(
        self, model: LinearModel, estimate: Estimate, clusters: Clusters, share: np.ndarray, least_left: float
    ) -> None:
        self._model, self._evidence, self._share, self._least_left = model, model.evidence, share, least_left
        self._estimate = estimate
        self.clusters = (clusters.track, clusters.part)
        self._counts = clusters.sizes[:2]
        self._of_fitted = [self._fitted_scores(*of) for of in zip(self.clusters, self._counts, strict=True)]
        prior = estimate.u[model.used] * model.precision
        track, part = (unit[model.used] for unit in clusters.of_random_effects())
        self._units, at = (track, part), np.arange(len(prior))
        self._all_counts = clusters.counts
        self._prior: list[SparseMatrix] = [
            sparse.csr_matrix((prior, (unit, at)), (count, len(prior)))
            for unit, count in zip(self._units, self._all_counts, strict=True)
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
        cluster_information = tuple(np.zeros((table.shape[0], len(information))) for table in self._prior)
        for name, matrix in columns.items():
            weight = self._evidence.information[name]
            information = information + np.asarray((matrix.T @ scaled(matrix, weight)).todense())
            square = matrix.power(2)
            whole += square.T @ weight
            floor += square.T @ (weight * self._share)
            for table, cluster, count in zip(cluster_information, self.clusters, self._counts, strict=True):
                table[:count] += summed_by(cluster, square, weight, count)
        left = np.clip(np.diag(information) / np.maximum(whole, 1e-300), 0, 1)
        tables = self._summed(columns, coefficients)
        cluster_information, floor = tuple(table * left for table in cluster_information), floor * left
        random = coefficients[: len(self._model.precision)]
        of_prior = random.T @ (self._model.precision[:, None] * random)
        own = np.diag(of_prior) / np.maximum(whole, 1e-300)
        is_of_random = (left - own < self._least_left) & (own > _ROUNDING)
        for column in np.flatnonzero(is_of_random):
            information[:, column] = information[column] = of_prior[column]
            of_unit = self._model.precision * random[:, column] ** 2
            floor[column], left[column] = of_prior[column, column], 1.0
            for table, share, unit, prior in zip(tables, cluster_information, self._units, self._prior, strict=True):
                table[:, column] = prior @ random[:, column]
                share[:, column] = np.bincount(unit, of_unit, len(share))
        return Projected(
            tables, (cluster_information[TRACK], cluster_information[PART]), information, left, floor, random,
            is_of_random,
        )  # fmt: skip

    def of_all(self, x: np.ndarray) -> np.ndarray:
        """Coefficients (m, k) of all random effects from those (a, k) of the active ones."""
        whole = np.zeros((len(self._estimate.u), x.shape[1]))
        whole[self._model.used] = x
        return whole

    def random_stratum(self, x: np.ndarray, one_sided: bool = False) -> RandomStratum | None:
        """Regression on columns with coefficients x (a, k) of the random effects that beams determine, or None.

        Random effects with a flat prior have no distribution that an error of theirs would contradict.
        """
        if not self._least_left or not np.any(x):
            return None
        track, part = self._units
        rows = np.flatnonzero(self._model.information.diagonal() > self._model.precision)  # better than their prior
        if not len(rows):
            return None
        return RandomStratum(
            self._estimate.u[self._model.used[rows]], x[rows], self._model.component[rows],
            len(self._estimate.variance), (track[rows], part[rows]), self._all_counts, one_sided,
        )  # fmt: skip

    def _summed(
        self, columns: dict[Quantity, SparseMatrix], cluster_information: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        tables = []
        for cluster, count, of_fitted, prior in zip(
            self.clusters, self._counts, self._of_fitted, self._prior, strict=True
        ):
            table = np.asarray(prior @ cluster_information[: prior.shape[1]])
            for name, matrix in columns.items():
                table[:count] += summed_by(cluster, matrix, self._evidence.score[name], count)
            table[:count] -= of_fitted @ cluster_information
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
