"""One scan of a recording, whatever file it came from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim.errors import CosimError


class RecordingError(CosimError):
    """A recording cannot be used as it is."""


@dataclass(frozen=True, eq=False)
class Scan:
    """The points of one revolution in the sensor's axes (x forward, y left, z up), in the order of the file.

    Attributes:
        name: of the file, or the number of the message.
        xyz: (n, 3) float64 [m]; every row is finite and not the origin.
        intensity: (n,) float32 in 0–1; None where the recording has none.
        ring: (n,) int64 as the driver numbers lasers, from any end; None where it does not.
        time_s: (n,) float64 seconds from the earliest point of the scan; None where points have no time.
        stamp_s: when the scan was taken, seconds of any epoch; None where nothing says so.
        dropped: rows of the file that were no returns: NaN, infinite, or at the origin.
    """

    name: str
    xyz: np.ndarray
    intensity: np.ndarray | None = None
    ring: np.ndarray | None = None
    time_s: np.ndarray | None = None
    stamp_s: float | None = None
    dropped: int = 0

    def __post_init__(self) -> None:
        if self.xyz.ndim != 2 or self.xyz.shape[1] != 3:
            raise RecordingError(f"{self.name}: points have shape {self.xyz.shape}; give (n, 3): x, y, z")
        for name in ("intensity", "ring", "time_s"):
            column = getattr(self, name)
            if column is not None and column.shape != (len(self.xyz),):
                raise RecordingError(f"{self.name}: {name} has shape {column.shape} for {len(self.xyz)} points")

    def __len__(self) -> int:
        return len(self.xyz)

    def __getitem__(self, rows: np.ndarray) -> Scan:
        """Some of the points, by mask or index array; the scan's own facts stay."""
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
