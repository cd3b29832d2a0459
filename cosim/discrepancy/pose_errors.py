"""How errors of a scan's pose move what its beams meet.

Of a plane met at R = n·(p − o)/(n·d), a shift of the sensor changes the numerator and a turn the denominator, so
R′ = (R + Δ)/(1 − Δ′/R) with Δ and Δ′ as the slopes at no error say. Far ground at a flat angle is far from linear: at
50 m a tenth of a degree of roll may move it by two metres, and the square of that by a tenth.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from cosim.discrepancy.system import SparseMatrix

_MOST_LIKE = 0.9
_FLATTEST = 0.5  # of the slope between a beam and its plane must outlive a turn


def independent_share(errors: np.ndarray) -> float:
    """How many facts errors (scans, k) of a series are to each of them: (1 − ρ)/(1 + ρ) of autocorrelation ρ."""
    square = float((errors**2).sum())
    likeness = float((errors[1:] * errors[:-1]).sum()) / square if square > 0 else 0.0
    likeness = float(np.clip(likeness, 0.0, _MOST_LIKE))
    return (1 - likeness) / (1 + likeness)


class PoseErrors:
    """Pose errors (scans, 6): shifts [m] and turns [rad] in the LiDAR's axes.

    Beams were traced with some already; how ranges change is told from there.

    Args:
        derivative: (n, 6) change of range per metre and radian.
        frame: (n,) int scan of each beam.
        reach_m: (n,) range of the plane it meets; NaN where there is none.
        traced: (scans, 6) those that beams were traced with.
    """

    def __init__(self, derivative: np.ndarray, frame: np.ndarray, reach_m: np.ndarray, traced: np.ndarray) -> None:
        self._derivative, self._frame = derivative, frame
        self._reach = np.nan_to_num(reach_m, nan=np.inf)
        columns = self._frame[:, None] * 6 + np.arange(6)
        rows = np.repeat(np.arange(len(frame)), 6)
        self._places = (rows, columns.ravel())
        self._shape = (len(frame), traced.size)
        self._traced = traced

    def shift(self, pose: np.ndarray) -> np.ndarray:
        """Change of ranges (n,) [m]."""
        return self._change(*self._parts(pose))

    def slopes(self, pose: np.ndarray) -> SparseMatrix:
        """(n, 6·scans) derivatives of `shift`."""
        moved, slope = self._parts(pose)
        farther = 1 + self._change(moved, slope) / self._reach
        scale = np.repeat(np.stack([1 / slope, farther / slope], 1), 3, axis=1)
        values = (self._derivative * scale).ravel()
        return sparse.csr_matrix((values, self._places), self._shape)

    def _parts(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Δ, and 1 − Δ′/R."""
        of_beam = (pose - self._traced)[self._frame]
        moved = np.einsum("ij,ij->i", self._derivative[:, :3], of_beam[:, :3])
        turned = np.einsum("ij,ij->i", self._derivative[:, 3:], of_beam[:, 3:])
        return moved, np.maximum(1 - turned / self._reach, _FLATTEST)

    def _change(self, moved: np.ndarray, slope: np.ndarray) -> np.ndarray:
        known = np.isfinite(self._reach)
        reach = np.where(known, self._reach, 0.0)
        return np.where(known, (reach + moved) / slope - reach, 0.0)
