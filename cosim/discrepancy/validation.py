"""Errors on frames that took no part in a fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Errors of a model on frames that took no part in its fit.

    Attributes:
        error: over all of them.
        by_frame: (f,) of each.
        beams: (f,) how many of each could be compared: what it counts for.
        floor: the error that noise alone would make; None where nothing tells.
    """

    error: float
    by_frame: np.ndarray
    beams: np.ndarray
    floor: float | None

    @property
    def standard_error(self) -> float:
        """Of the error, from frame to frame; NaN of one frame."""
        used = np.isfinite(self.by_frame) & (self.beams > 0)
        values, count = self.by_frame[used], int(used.sum())
        share = self.beams[used] / max(self.beams[used].sum(), 1)
        if count < 2:
            return float("nan")
        return float(np.sqrt((share**2 @ (values - share @ values) ** 2) * count / (count - 1)))
