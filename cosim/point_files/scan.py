"""One scan, whatever file it comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from cosim.errors import FormatError


class PointFileError(FormatError):
    """A point file cannot be read, or its numbers have no meaning that all clues agree on."""


class UnequalRowsError(PointFileError):
    """Scans have rows of different numbers of columns."""


@dataclass(frozen=True, eq=False)
class Scan:
    """The points of one revolution in the sensor's axes (x forward, y left, z up), in the order of the file.

    Attributes:
        name: of the file, or the number of the message.
        xyz: (n, 3) float64 [m]; every row is finite and not the origin.
        intensity: (n,) float32 in 0–1; None where the file has none.
        ring: (n,) int64 as the driver numbers lasers, from any end; None where it does not.
        time_s: (n,) float64 seconds from the earliest point of the scan; None where points have no time.
        stamp_s: time of the scan, seconds of any epoch; None where it is not known.
        dropped: number of rows of the file that were left out.
        left_out: number of rows that were left out, by reason.
    """

    name: str
    xyz: np.ndarray
    intensity: np.ndarray | None = None
    ring: np.ndarray | None = None
    time_s: np.ndarray | None = None
    stamp_s: float | None = None
    dropped: int = 0
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.xyz.ndim != 2 or self.xyz.shape[1] != 3:
            raise PointFileError(f"{self.name}: points have shape {self.xyz.shape}; give (n, 3): x, y, z")
        for name in ("intensity", "ring", "time_s"):
            column = getattr(self, name)
            if column is not None and column.shape != (len(self.xyz),):
                raise PointFileError(f"{self.name}: {name} has shape {column.shape} for {len(self.xyz)} points")

    def __len__(self) -> int:
        return len(self.xyz)

    def __getitem__(self, rows: np.ndarray) -> Scan:
        """A part of the points, by mask or index array; name and stamp stay."""
        columns = {name: getattr(self, name) for name in ("intensity", "ring", "time_s")}
        thinned = {name: None if column is None else column[rows] for name, column in columns.items()}
        return replace(self, xyz=self.xyz[rows], **thinned)

    @property
    def flat_range_m(self) -> np.ndarray:
        """(n,) distances from the sensor's vertical axis [m]."""
        return np.hypot(self.xyz[:, 0], self.xyz[:, 1])

    @property
    def azimuth_rad(self) -> np.ndarray:
        """(n,) azimuths of the points, counter-clockwise from +x, in (−π, π]."""
        return np.arctan2(self.xyz[:, 1], self.xyz[:, 0])
