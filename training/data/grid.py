"""A regular grid of pillars or voxels."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Grid:
    """A regular grid.

    Attributes:
        low, high: corners [m].
        size: of a cell, x, y, z [m].
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    size: tuple[float, float, float]

    @property
    def cells(self) -> tuple[int, int, int]:
        """Numbers of cells along x, y, z."""
        nx, ny, nz = (round((h - b) / s) for b, h, s in zip(self.low, self.high, self.size, strict=True))
        return nx, ny, nz
