"""One grid of lasers × azimuth for two sets of scans, so that their patches are comparable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.drives.kitti import Frame
from cosim.errors import FormatError

_SAMPLED_FRAMES = 5
_MOST_STEP_RAD = 0.02  # of neighbours within a ring; more is a gap
_ELEVATION_ROWS = 32
_BOUNDS = (0.5, 99.5)  # percentiles of elevation that bins cover


@dataclass(frozen=True)
class PatchGrid:
    """Cells of a scan: one row a laser (or a bin of elevation), one column an azimuth step.

    Attributes:
        rows: number of rows, top first.
        elevation_edges_rad: (rows + 1,) falling edges of the rows; None where rows are lasers.
        step_rad: width of a column.
        sector_rad: width of the sector about the forward direction.
        patch: rows and columns of a patch.
    """

    rows: int
    elevation_edges_rad: np.ndarray | None
    step_rad: float
    sector_rad: float
    patch: tuple[int, int] = (16, 40)

    @property
    def columns(self) -> int:
        """Number of columns: whole patches only."""
        return int(self.sector_rad / self.step_rad) // self.patch[1] * self.patch[1]

    @property
    def patch_counts(self) -> tuple[int, int]:
        """Rows and columns of patches in a scan."""
        return self.rows // self.patch[0], self.columns // self.patch[1]

    @classmethod
    def common(cls, sets: Sequence[Sequence[Frame]], sector_deg: float) -> PatchGrid:
        """The grid for sets of frames: rows are lasers where all sets have the same number of them.

        Otherwise rows are equal bins of elevation over what all sets cover. Columns have the largest of the sets'
        median azimuth steps.

        Raises:
            FormatError: a scan holds too few points.
        """
        rings, steps, bounds = set(), [], []
        for frames in sets:
            chosen = [frames[k] for k in np.unique(np.linspace(0, len(frames) - 1, _SAMPLED_FRAMES).astype(int))]
            lasers = [laser_of_points(frame) for frame in chosen]
            found = [laser for laser in lasers if laser is not None]
            rings.add(int(max(laser.max() for laser in found)) + 1 if len(found) == len(lasers) else None)
            steps.append(float(np.median([_azimuth_step(f, laser) for f, laser in zip(chosen, lasers, strict=True)])))
            elevation = np.concatenate([_elevation(frame.points) for frame in chosen])
            bounds.append(np.percentile(elevation, _BOUNDS))
        step, sector = max(steps), float(np.radians(sector_deg))
        count = rings.pop()
        if not rings and count is not None and count >= 4:
            rows = 16 if count >= 16 else count
            return cls(count, None, step, sector, (rows, 40))
        low, high = max(bound[0] for bound in bounds), min(bound[1] for bound in bounds)
        return cls(_ELEVATION_ROWS, np.linspace(high, low, _ELEVATION_ROWS + 1), step, sector)

    def cells(self, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        """Nearest point of each cell, (rows, columns) int64 rows of points, −1 for none, and all ranges (n,) [m]."""
        points = frame.points
        distance = np.sqrt(np.einsum("ij,ij->i", points[:, :3], points[:, :3]))
        if self.elevation_edges_rad is None:
            row = laser_of_points(frame)
            if row is None:
                raise FormatError(
                    f"{frame.path('velodyne')}: its lasers are unknown, but those of the set's other scans are known"
                )
            row = row.astype(np.int64)
        else:
            row = np.searchsorted(-self.elevation_edges_rad, -_elevation(points), side="right") - 1
        azimuth = np.arctan2(points[:, 1], points[:, 0])
        column = np.floor((self.columns * self.step_rad / 2 - azimuth) / self.step_rad).astype(np.int64)
        inside = np.flatnonzero((row >= 0) & (row < self.rows) & (column >= 0) & (column < self.columns))
        inside = inside[np.argsort(-distance[inside], kind="stable")]  # the nearest is written last
        table = np.full((self.rows, self.columns), -1, np.int64)
        table[row[inside], column[inside]] = inside
        return table, distance


def laser_of_points(frame: Frame) -> np.ndarray | None:
    """The laser of every point, (n,) uint8; None where it is not known."""
    try:
        return frame.rays.ring
    except FormatError:
        if frame.has("rays"):
            raise
        return None


def _azimuth_step(frame: Frame, ring: np.ndarray | None) -> float:
    points = frame.points
    if len(points) < 2:
        raise FormatError(f"{frame.path('velodyne')}: holds {len(points)} points; a grid needs more")
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    if ring is None:
        elevation = _elevation(points)
        ring = np.digitize(elevation, np.linspace(elevation.min(), elevation.max(), 2 * _ELEVATION_ROWS))
    order = np.lexsort((azimuth, ring))
    steps = np.diff(azimuth[order])[np.diff(ring[order].astype(int)) == 0]
    steps = steps[(steps > 1e-5) & (steps < _MOST_STEP_RAD)]
    return float(np.median(steps)) if len(steps) else _MOST_STEP_RAD


def _elevation(points: np.ndarray) -> np.ndarray:
    return np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
