"""Change of ranges by pose errors of the scans.

A beam from o in direction d hits a plane through p with normal n at the range R = n·(p − o)/(n·d). A shift of the
sensor changes the numerator, a rotation the denominator: R′ = (R + Δ)/(1 − Δ′/R), where Δ and Δ′ are the linear changes
of R [m] by shift and rotation. This is strongly nonlinear for distant ground at grazing incidence: at 50 m a roll error
of 0.1° may change R by 2 m, with a second-order term of 0.1 m. Effects that rotate beams change the same denominator:
if they have changed the range to R₁, R′ = (R + Δ)/(R/R₁ − Δ′/R). With a sum of both changes instead, a rotation by an
effect and an opposite pose error would not cancel on distant ground.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from cosim.discrepancy.inference.score import SparseMatrix
from cosim.discrepancy.settings import DEFAULT, RandomEffectSettings


class PoseErrors:
    """Effect of pose errors (scans, 6), shifts [m] and rotations [rad] in LiDAR axes, on the ranges of n beams.

    Args:
        derivative: (n, 6) derivative of the range with respect to the pose [m/m, m/rad].
        frame: (n,) int scan of each beam.
        reach_m: (n,) range [m] of the plane that is hit; NaN for misses.
        scans: number of scans.
        settings: settings of the random effects.
    """

    def __init__(
        self,
        derivative: np.ndarray,
        frame: np.ndarray,
        reach_m: np.ndarray,
        scans: int,
        settings: RandomEffectSettings = DEFAULT.random_effects,
    ) -> None:
        self._settings = settings
        self._derivative, self._frame = derivative, frame
        self._reach = np.nan_to_num(reach_m, nan=np.inf)
        columns = self._frame[:, None] * 6 + np.arange(6)
        self._columns = columns.ravel().astype(np.int32), np.arange(len(frame) + 1, dtype=np.int32) * 6
        self._shape = (len(frame), 6 * scans)

    def shift(self, pose: np.ndarray, bent_m: np.ndarray | None = None) -> np.ndarray:
        """Change (n,) of the ranges [m]; `bent_m` (n,) are the ranges as changed by effects (default: as traced)."""
        bent = self._range_ratio(bent_m)
        moved, slope = self._numerator_and_denominator(pose, bent)
        known = np.isfinite(self._reach)
        reach = np.where(known, self._reach, 0.0)
        return np.where(known, (reach + moved) / slope - reach / bent, 0.0)

    def slopes(self, pose: np.ndarray, bent_m: np.ndarray | None = None) -> SparseMatrix:
        """Sparse (n, 6·scans) derivatives of `shift` with respect to the pose errors."""
        moved, slope = self._numerator_and_denominator(pose, self._range_ratio(bent_m))
        farther = (1 + moved / self._reach) / slope
        scale = np.repeat(np.stack([1 / slope, farther / slope], 1), 3, axis=1)
        values = (self._derivative * scale).ravel()
        return sparse.csr_matrix((values, *self._columns), self._shape)

    def range_derivative(self, pose: np.ndarray, bent_m: np.ndarray) -> np.ndarray:
        """(n,) dR′/dR₁, with the ranges `bent_m` (n,) [m] as changed by effects."""
        moved, slope = self._numerator_and_denominator(pose, self._range_ratio(bent_m))
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = self._reach / bent_m
            found = (1 + moved / self._reach) * (ratio / slope) ** 2
        return np.where(np.abs(ratio - 1) < self._settings.same_surface, found, 1.0)

    def _range_ratio(self, bent_m: np.ndarray | None) -> np.ndarray:
        """R/R₁; 1 if R₁ belongs to another surface."""
        if bent_m is None:
            return np.ones_like(self._reach)
        with np.errstate(invalid="ignore"):
            ratio = self._reach / bent_m
            return np.where(np.abs(ratio - 1) < self._settings.same_surface, ratio, 1.0)

    def _numerator_and_denominator(self, pose: np.ndarray, bent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return Δ [m] and R/R₁ − Δ′/R, arrays (n,)."""
        of_beam = pose[self._frame]
        moved = np.einsum("ij,ij->i", self._derivative[:, :3], of_beam[:, :3])
        turned = np.einsum("ij,ij->i", self._derivative[:, 3:], of_beam[:, 3:])
        return moved, np.maximum(bent - turned / self._reach, self._settings.flattest)
