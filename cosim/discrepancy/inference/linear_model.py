"""A mixed model, linear about a fit: what a step of parameters knows that random effects may take up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.inference.score import (
    Column,
    Evidence,
    Factored,
    Quantity,
    SparseMatrix,
    ridged,
    scaled,
    stacked,
)
from cosim.discrepancy.sampling.sample import Prediction


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A mixed model, linear about a fit: `score ≈ X β + Z u`, u of known precision.

    Attributes:
        x: (n, p) columns of the fitted parameters by quantity.
        z: (n, a) columns of the active random effects by quantity.
        used: (a,) which random effects these are.
        precision: (a,) of their laws.
        known: (a, a) information of z.
        solver: of `known` and the precision.
        evidence: scores and informations.
    """

    x: dict[Quantity, SparseMatrix]
    z: dict[Quantity, SparseMatrix]
    used: np.ndarray
    precision: np.ndarray
    known: SparseMatrix
    solver: Factored | None
    evidence: Evidence

    @classmethod
    def of(
        cls,
        random: RandomEffects,
        columns: Sequence[Column],
        evidence: Evidence,
        prediction: Prediction,
        estimate: Estimate,
    ) -> LinearModel:
        """About a prediction and random effects."""
        used = np.flatnonzero(random.active(estimate))
        designs = random.designs(prediction, estimate)
        z: dict[Quantity, SparseMatrix] = {
            name: one.tocsc()[:, used].tocsr() for name, one in designs.items() if name in evidence.score
        }
        known = sparse.csr_matrix((len(used), len(used)))
        for name, one in z.items():
            if one.nnz:
                known = known + one.T @ scaled(one, evidence.information[name])
        precision = random.precision(estimate)[used]
        solver = Factored(known + sparse.diags(precision), random.independent_blocks[used]) if len(used) else None
        x = stacked(columns, evidence.score, len(random.sample))
        return cls(x, z, used, precision, known, solver, evidence)

    def projected(self, columns: dict[Quantity, SparseMatrix]) -> tuple[np.ndarray, np.ndarray]:
        """How much of each random effect and parameter a unit of columns (n, k) is worth, (a + p, k).

        Beside it the information that the columns share with them, (a + p, k).
        """
        shared = self._shared(columns, self.z, len(self.used))
        of_x = self._shared(columns, self.x, self.parameters)
        random, fixed = self._solve(shared), np.zeros((0, shared.shape[1]))
        if self.parameters:
            fixed = np.linalg.solve(self.fixed_information, of_x - self._across.T @ random)
            random = random - self._across_solved @ fixed
        return np.vstack([random, fixed]), np.vstack([shared, of_x])

    @cached_property
    def parameters(self) -> int:
        """p."""
        return next(iter(self.x.values())).shape[1] if self.x else 0

    @cached_property
    def fixed_information(self) -> np.ndarray:
        """(p, p) information of the parameters, random effects eliminated."""
        return ridged(self._own_information - self._across.T @ self._across_solved)

    @property
    def own_information_diagonal(self) -> np.ndarray:
        """(p,) information of each parameter if the others and the random effects were known."""
        return np.diag(self._own_information)

    def beside(self, columns: dict[Quantity, SparseMatrix]) -> LinearModel:
        """The same with further parameters, (n, k) columns by quantity."""
        rows = len(next(iter(self.evidence.score.values())))
        width = next(iter(columns.values())).shape[1]
        x: dict[Quantity, SparseMatrix] = {}
        for name in dict.fromkeys((*self.x, *columns)):
            own = self.x.get(name, sparse.csr_matrix((rows, self.parameters)))
            more = columns.get(name, sparse.csr_matrix((rows, width)))
            x[name] = sparse.hstack([own, more], format="csr")
        return replace(self, x=x)

    def step(
        self, estimate: Estimate, least_told: float = 0.0, law: tuple[np.ndarray, np.ndarray] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """A Gauss–Newton step of parameters (p,) and of all random effects (m,).

        Args:
            estimate: random effects as they are.
            least_told: share of what would be known of parameters one by one, which random effects and the other
                parameters must leave of a direction; with less the step does not go that way, as nothing tells how far.
            law: precisions (p,) of normal laws of the parameters, and how far these are from their means (p,).
        """
        right = self._scored(self.z, len(self.used)) - self.precision * estimate.u[self.used]
        step = np.zeros(self.parameters)
        if self.parameters:
            slope = self._scored(self.x, self.parameters) - self._across.T @ self._solve(right)
            if law is None:
                step = self._told(slope, self.fixed_information, least_told)
            else:
                step = self._told(slope - law[0] * law[1], self.fixed_information + np.diag(law[0]), least_told)
        change = np.zeros(len(estimate.u))
        change[self.used] = self._solve(right - self._across @ step)
        return step, change

    def _told(self, slope: np.ndarray, information: np.ndarray, least: float) -> np.ndarray:
        """The step (p,) of a slope (p,), along directions of which a share is left of what is known one by one."""
        if not least:
            return np.linalg.solve(information, slope)
        known = np.diag(self._own_information)
        scale = np.sqrt(np.where(known > 0, known, 1.0))
        share, way = np.linalg.eigh(information / np.outer(scale, scale))
        way, share = way[:, share > least], share[share > least]
        return way @ ((way.T @ (slope / scale)) / share) / scale

    def shrinkage(self) -> float:
        """log |I + D^½ ZᵀWZ D^½|: what the freedom of the random effects costs."""
        if self.solver is None:
            return 0.0
        return self.solver.log_determinant() - float(np.log(self.precision).sum())

    @cached_property
    def _own_information(self) -> np.ndarray:
        """(p, p) information of the parameters, random effects known."""
        return self._shared(self.x, self.x, self.parameters)

    @cached_property
    def _across(self) -> np.ndarray:
        """(a, p) information shared by random effects and parameters."""
        return self._shared(self.x, self.z, len(self.used))

    @cached_property
    def _across_solved(self) -> np.ndarray:
        return self._solve(self._across)

    def _solve(self, right: np.ndarray) -> np.ndarray:
        return right if self.solver is None or not right.size else self.solver.solve(right)

    def _shared(
        self, columns: dict[Quantity, SparseMatrix], own: dict[Quantity, SparseMatrix], size: int
    ) -> np.ndarray:
        width = next(iter(columns.values())).shape[1] if columns else 0
        found = np.zeros((size, width))
        for name, one in columns.items():
            if name in own and own[name].nnz and one.nnz and name in self.evidence.information:
                found += (own[name].T @ scaled(one, self.evidence.information[name])).toarray()
        return found

    def _scored(self, own: dict[Quantity, SparseMatrix], size: int) -> np.ndarray:
        found = np.zeros(size)
        for name, one in own.items():
            found += one.T @ self.evidence.score[name]
        return found
