"""Patches of a set's scans with their figures, their region and where they come from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.drives.kitti import Frame, points_in_boxes
from cosim.stats.two_sample.figures import measure_figures
from cosim.stats.two_sample.grid import PatchGrid
from cosim.stats.two_sample.regions import REGIONS, region_of_cells

_FEWEST_RETURNS = 0.05  # share of cells; patches with less say nothing
_REGION_SHARE = 0.3


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of a set.

    Attributes:
        unit: (n,) int64 the frame, block or drive each belongs to, from 0.
        frame: (n,) names of frames.
        place: (n, 2) int64 row and column of patches in the scan.
        figures: (n, 25) float32, see `FIGURES`.
        region: (n, k) bool which of `REGIONS` fill a good part of it.
        pictures: (n, 2, rows, columns) float16 ranges [m] and intensities, NaN where there is no return.
    """

    unit: np.ndarray
    frame: np.ndarray
    place: np.ndarray
    figures: np.ndarray
    region: np.ndarray
    pictures: np.ndarray

    def __len__(self) -> int:
        return len(self.unit)

    @property
    def units(self) -> int:
        """Number of units."""
        return int(self.unit.max(initial=-1)) + 1

    def take(self, rows: np.ndarray) -> Patches:
        """A selection of the patches, with units renumbered."""
        unit = np.unique(self.unit[rows], return_inverse=True)[1]
        return Patches(
            unit, *(getattr(self, name)[rows] for name in ("frame", "place", "figures", "region", "pictures"))
        )


def collect_patches(
    frames: Sequence[Frame], grid: PatchGrid, units: Sequence[int], on_frame: Callable[[str], None] = lambda name: None
) -> Patches:
    """Cut scans into patches.

    Args:
        frames: read one after another.
        grid: cells and patches.
        units: number of the unit of each frame.
        on_frame: called with the name of every frame before it is read.

    Raises:
        CosimError: a scan, label or calibration is broken.
    """
    units_, names, cuts = [], [], []
    for unit, frame in zip(units, frames, strict=True):
        on_frame(frame.name)
        cut = _cut(frame, grid)
        units_.append(np.full(len(cut[0]), unit))
        names.append(np.full(len(cut[0]), frame.name))
        cuts.append(cut)
    unit = np.unique(np.concatenate(units_), return_inverse=True)[1]
    return Patches(unit, np.concatenate(names), *(np.concatenate(column) for column in zip(*cuts, strict=True)))


def _cut(frame: Frame, grid: PatchGrid) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    table, distance = grid.cells(frame)
    points = frame.points
    there = table >= 0
    range_m = np.where(there, distance[table], np.nan).astype(np.float32)
    intensity = np.where(there, points[table, 3], np.nan).astype(np.float32)
    boxes = None
    if frame.has("label_2") and frame.has("calib"):
        labels = frame.labels.cared_for
        boxes = labels.boxes_velo(frame.calibration) if len(labels) else None
    on_object = np.zeros(len(points), bool) if boxes is None else np.any(points_in_boxes(points, boxes), axis=0)
    region = region_of_cells(points, table, on_object)
    tiles = [_tiles(values, grid) for values in (range_m, intensity, region)]
    answered = np.isfinite(tiles[0])
    used = np.flatnonzero(answered.mean((1, 2)) >= _FEWEST_RETURNS)
    down, right = grid.patch_counts
    position = np.stack(np.divmod(np.arange(down * right), right), 1)[used]
    range_tiles, intensity_tiles, region_tiles = (tile[used] for tile in tiles)
    count = np.maximum(answered[used].sum((1, 2)), 1)
    shares = np.stack([(region_tiles == k).sum((1, 2)) / count for k in range(len(REGIONS))], 1)
    pictures = np.stack([range_tiles, intensity_tiles], 1).astype(np.float16)
    return position, measure_figures(range_tiles, intensity_tiles), shares >= _REGION_SHARE, pictures


def _tiles(values: np.ndarray, grid: PatchGrid) -> np.ndarray:
    (down, right), (height, width) = grid.patch_counts, grid.patch
    cut = values[: down * height, : right * width].reshape(down, height, right, width)
    return cut.swapaxes(1, 2).reshape(down * right, height, width)
