"""How errors of a scan's pose move what its beams meet.

Of a plane met at R = n·(p − o)/(n·d), a shift of the sensor changes the numerator and a turn the denominator, so
R′ = (R + Δ)/(1 − Δ′/R) with Δ and Δ′ as the slopes at no error say. Far ground at a flat angle is far from linear: at
50 m a tenth of a degree of roll may move it by two metres, and the square of that by a tenth. Effects that turn
beams, too, change the same denominator: where they have moved the surface to R₁, R′ = (R + Δ)/(R/R₁ − Δ′/R). Added up
instead, a turn by an effect and its undoing by the pose would leave a tenth of a metre on far ground.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from cosim.discrepancy.inference.score import SparseMatrix
from cosim.discrepancy.settings import DEFAULT, Unsure


class PoseErrors:
    """Pose errors (scans, 6): shifts [m] and turns [rad] in the LiDAR's axes.

    Args:
        derivative: (n, 6) change of range per metre and radian.
        frame: (n,) int scan of each beam.
        reach_m: (n,) range of the plane it meets; NaN where there is none.
        scans: how many.
        settings: numbers that decide.
    """

    def __init__(
        self,
        derivative: np.ndarray,
        frame: np.ndarray,
        reach_m: np.ndarray,
        scans: int,
        settings: Unsure = DEFAULT.unsure,
    ) -> None:
        self._settings = settings
        self._derivative, self._frame = derivative, frame
        self._reach = np.nan_to_num(reach_m, nan=np.inf)
        columns = self._frame[:, None] * 6 + np.arange(6)
        rows = np.repeat(np.arange(len(frame)), 6)
        self._places = (rows, columns.ravel())
        self._shape = (len(frame), 6 * scans)

    def shift(self, pose: np.ndarray, bent_m: np.ndarray | None = None) -> np.ndarray:
        """Change of ranges (n,) [m], which effects have brought to `bent_m` (n,); as they were traced by default."""
        bent = self._bent(bent_m)
        moved, slope = self._parts(pose, bent)
        known = np.isfinite(self._reach)
        reach = np.where(known, self._reach, 0.0)
        return np.where(known, (reach + moved) / slope - reach / bent, 0.0)

    def slopes(self, pose: np.ndarray, bent_m: np.ndarray | None = None) -> SparseMatrix:
        """(n, 6·scans) derivatives of `shift`."""
        moved, slope = self._parts(pose, self._bent(bent_m))
        farther = (1 + moved / self._reach) / slope
        scale = np.repeat(np.stack([1 / slope, farther / slope], 1), 3, axis=1)
        values = (self._derivative * scale).ravel()
        return sparse.csr_matrix((values, self._places), self._shape)

    def onward(self, pose: np.ndarray, bent_m: np.ndarray) -> np.ndarray:
        """(n,) dR′/dR₁: how much farther a surface comes out that effects have brought to `bent_m` (n,), per metre."""
        moved, slope = self._parts(pose, self._bent(bent_m))
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = self._reach / bent_m
            found = (1 + moved / self._reach) * (ratio / slope) ** 2
        return np.where(np.abs(ratio - 1) < self._settings.same_surface, found, 1.0)

    def _bent(self, bent_m: np.ndarray | None) -> np.ndarray:
        """R/R₁; 1 where that is another surface's."""
        if bent_m is None:
            return np.ones_like(self._reach)
        with np.errstate(invalid="ignore"):
            ratio = self._reach / bent_m
            return np.where(np.abs(ratio - 1) < self._settings.same_surface, ratio, 1.0)

    def _parts(self, pose: np.ndarray, bent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Δ, and R/R₁ − Δ′/R."""
        of_beam = pose[self._frame]
        moved = np.einsum("ij,ij->i", self._derivative[:, :3], of_beam[:, :3])
        turned = np.einsum("ij,ij->i", self._derivative[:, 3:], of_beam[:, 3:])
        return moved, np.maximum(bent - turned / self._reach, self._settings.flattest)
