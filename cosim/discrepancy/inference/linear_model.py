"""Linearised mixed model about a fit: Gauss–Newton steps with the random effects eliminated.

Notation of Henderson's mixed model equations: fixed parameters β with columns X, random effects u with columns Z,
weights W (information of each beam) and precision Λ of u.
"""

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
    """Mixed model, linearised about a fit: change of the prediction = X β + Z u, with known precision of u.

    Attributes:
        x: (n, p) columns of the fitted parameters by quantity.
        z: (n, a) columns of the active random effects by quantity.
        used: (a,) int indices of the active random effects.
        precision: (a,) their inverse variances (diagonal of Λ).
        information: (a, a) information ZᵀWZ.
        component: (a,) int variance component of each active random effect.
        solver: factorisation of ZᵀWZ + Λ; None without random effects.
        evidence: scores and informations of the beams.
    """

    x: dict[Quantity, SparseMatrix]
    z: dict[Quantity, SparseMatrix]
    used: np.ndarray
    precision: np.ndarray
    information: SparseMatrix
    component: np.ndarray
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
        """Linearise about a prediction and an estimate of the random effects."""
        used = np.flatnonzero(random.active(estimate))
        designs = random.designs(prediction, estimate)
        z: dict[Quantity, SparseMatrix] = {name: one for name, one in designs.items() if name in evidence.score}
        information = sparse.csr_matrix((len(used), len(used)))
        for name, matrix in z.items():
            if matrix.nnz:
                information = information + matrix.T @ scaled(matrix, evidence.information[name])
        precision = random.precision(estimate)[used]
        solver = Factored(information + sparse.diags(precision), random.independent_blocks[used]) if len(used) else None
        x = stacked(columns, evidence.score, len(random.sample))
        return cls(x, z, used, precision, information, random.component[used], solver, evidence)

    def projected(self, columns: dict[Quantity, SparseMatrix]) -> tuple[np.ndarray, np.ndarray]:
        """Regress columns (n, k) on the random effects and parameters.

        Returns:
            coefficients (a + p, k), and the cross-information (a + p, k) of the columns with random effects and
            parameters.
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
        """Number p of parameters."""
        return next(iter(self.x.values())).shape[1] if self.x else 0

    @cached_property
    def fixed_information(self) -> np.ndarray:
        """(p, p) information of the parameters with the random effects eliminated (Schur complement)."""
        return ridged(self._own_information - self._across.T @ self._across_solved)

    @property
    def own_information_diagonal(self) -> np.ndarray:
        """(p,) information of each parameter if the others and the random effects were known."""
        return np.diag(self._own_information)

    def beside(self, columns: dict[Quantity, SparseMatrix]) -> LinearModel:
        """Return the model with further parameters, given by their columns (n, k) by quantity."""
        rows = len(next(iter(self.evidence.score.values())))
        width = next(iter(columns.values())).shape[1]
        x: dict[Quantity, SparseMatrix] = {}
        for name in dict.fromkeys((*self.x, *columns)):
            own = self.x.get(name, sparse.csr_matrix((rows, self.parameters)))
            more = columns.get(name, sparse.csr_matrix((rows, width)))
            x[name] = sparse.hstack([own, more], format="csr")
        return replace(self, x=x)

    def step(
        self,
        estimate: Estimate,
        min_share: float = 0.0,
        prior: tuple[np.ndarray, np.ndarray] | None = None,
        damping: float = 0.0,
        limits: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute a Gauss–Newton step of the parameters (p,) and of all random effects (m,).

        Where the step would exceed its limits, it ends there, and the step of everything else is that for these values
        (projected Newton method: Bertsekas, SIAM J. Control Optim. 20, 1982).

        Args:
            estimate: current random effects.
            min_share: minimum share of information in a direction of parameter space that must remain after
                elimination of random effects and other parameters; the step has no component along other directions,
                which are not identifiable.
            prior: precisions (p,) of normal priors of the parameters, and current distances (p,) from their means.
            damping: share of each parameter's own information that is added to it (Marquardt, SIAM J. 1963).
            limits: smallest and largest step (p,) of each parameter.
        """
        right = self._scored(self.z, len(self.used)) - self.precision * estimate.u[self.used]
        step = np.zeros(self.parameters)
        if self.parameters:
            gradient = self._scored(self.x, self.parameters) - self._across.T @ self._solve(right)
            information = self.fixed_information + damping * np.diag(self.own_information_diagonal)
            if prior is not None:
                gradient, information = gradient - prior[0] * prior[1], information + np.diag(prior[0])
            step = self._bounded_step(gradient, information, min_share, limits)
        change = np.zeros(len(estimate.u))
        change[self.used] = self._solve(right - self._across @ step)
        return step, change

    def _bounded_step(
        self,
        gradient: np.ndarray,
        information: np.ndarray,
        min_share: float,
        limits: tuple[np.ndarray, np.ndarray] | None,
    ) -> np.ndarray:
        """Solve for the step (p,) from a gradient (p,), within its limits."""
        own, within = self.own_information_diagonal, np.ones(len(gradient), bool)
        step = _restricted_step(gradient, information, own, min_share)
        while limits is not None:
            bounded = np.clip(step, *limits)
            exceeds = within & (bounded != step)
            if not exceeds.any():
                break
            within &= ~exceeds
            step = np.where(within, 0.0, bounded)
            rest = (gradient - information @ step)[within]
            step[within] = _restricted_step(rest, information[np.ix_(within, within)], own[within], min_share)
        return step

    def shrinkage(self) -> float:
        """log |I + D^½ ZᵀWZ D^½| with D = Λ⁻¹: penalty for the random effects in the Laplace approximation."""
        if self.solver is None:
            return 0.0
        return self.solver.log_determinant() - float(np.log(self.precision).sum())

    @cached_property
    def _own_information(self) -> np.ndarray:
        """(p, p) information of the parameters for known random effects."""
        return self._shared(self.x, self.x, self.parameters)

    @cached_property
    def _across(self) -> np.ndarray:
        """(a, p) cross-information ZᵀWX of random effects and parameters."""
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
        total = np.zeros((size, width))
        for name, matrix in columns.items():
            if name in own and own[name].nnz and matrix.nnz and name in self.evidence.information:
                total += (own[name].T @ scaled(matrix, self.evidence.information[name])).toarray()
        return total

    def _scored(self, own: dict[Quantity, SparseMatrix], size: int) -> np.ndarray:
        total = np.zeros(size)
        for name, matrix in own.items():
            total += matrix.T @ self.evidence.score[name]
        return total


def _restricted_step(gradient: np.ndarray, information: np.ndarray, own: np.ndarray, min_share: float) -> np.ndarray:
    """Solve for the step (p,) from a gradient (p,), restricted to directions with enough of their `own` (p,)."""
    if not min_share:
        return np.linalg.solve(information, gradient)
    scale = np.sqrt(np.where(own > 0, own, 1.0))
    shares, directions = np.linalg.eigh(information / np.outer(scale, scale))
    directions, shares = directions[:, shares > min_share], shares[shares > min_share]
    return directions @ ((directions.T @ (gradient / scale)) / shares) / scale
