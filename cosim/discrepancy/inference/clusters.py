"""Clusters of beams that share errors, for robust variances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.sampling.sample import Sample


@dataclass(frozen=True, eq=False)
class Clusters:
    """Clusters of n beams that share errors: by the object or place that they hit, and by scan.

    Attributes:
        track: (n,) int number of the instance, or of a square of the map.
        scan: (n,) int number of the scan.
        part: (n,) int number of the scan, or of the sector of a scan if there are few scans.
        unit_track, unit_scan: (m,) int track and scan that each random effect belongs to; −1 for none.
    """

    track: np.ndarray
    scan: np.ndarray
    part: np.ndarray
    unit_track: np.ndarray
    unit_scan: np.ndarray

    @property
    def counts(self) -> tuple[int, int]:
        """Number of clusters by track and by part of a scan, those of `of_random_effects` included."""
        tracks, parts, scans = self.sizes
        return tracks + scans, parts + scans + tracks

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of clusters of beams by track, by part of a scan, and by scan."""
        return tuple(int(of.max(initial=-1)) + 1 for of in (self.track, self.part, self.scan))

    def of_random_effects(self) -> tuple[np.ndarray, np.ndarray]:
        """Cluster (m,) int of each random effect among the tracks, and among the parts of scans.

        Errors of poses are additional clusters among the tracks; errors of objects and of the map, among the parts.
        """
        tracks, parts, scans = self.sizes
        is_of_track = self.unit_track >= 0
        by_track = np.where(is_of_track, self.unit_track, tracks + self.unit_scan)
        by_part = np.where(is_of_track, parts + scans + self.unit_track, parts + self.unit_scan)
        return by_track, by_part


def joined_cells(sample: Sample, most: int) -> np.ndarray:
    """Number (n,) of the instance, square of map cells, or sector of the sky that each beam hits.

    Squares have sides of `most` cells; smaller ones where the map is so small that there would be few of them.
    """
    cells, settings = sample.cells, sample.settings
    is_cell = np.isfinite(cells[:, 0])
    keys = np.zeros((len(cells), 4), int)
    keys[~is_cell, 0] = 1 + np.flatnonzero(~is_cell)
    keys[is_cell, 1] = cells[is_cell, 0]
    number = np.arange(len(cells))
    for side in range(most, 0, -1):
        keys[is_cell, 2:] = np.floor(cells[is_cell, 1:] / (side * settings.sampling.cell_m))
        number = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
        if len(np.unique(number[is_cell])) >= settings.random_effects.fewest_squares:
            break
    return number[sample.track]
