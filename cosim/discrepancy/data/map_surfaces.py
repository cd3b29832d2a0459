"""Surfaces of a twin that is a map made of the drive's own scans: `twin/surfels.npz`, or `twin/surfels/` of several.

Such a map says nothing of where its surfaces and scans stand: both were fitted to the very points that are to be
judged. So the place of every surface along its normal, its reflectance and the poses of scans are free, and what is
left to tell effects is what differs between looks at one surface. Beams are compared where they meet a surface of the
map and return from about it; a return from elsewhere is something that the map does not hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim.discrepancy.settings import DEFAULT, Sampling
from cosim.drives.kitti import Drive
from cosim.drives.twin.surfels import SurfelMap, has_surfels, read_surfels, surfel_file
from sensors.hits import STATIC


class Maps:
    """The maps of a drive's scans, read when they are asked for.

    Args:
        drive: whose twin may be a map.
        settings: numbers that decide.
    """

    def __init__(self, drive: Drive, settings: Sampling = DEFAULT.sampling) -> None:
        self._settings = settings
        self._drive = drive if has_surfels(drive.root) else None
        self._read: dict[Path, MapSurfaces] = {}

    def of(self, static: str | None) -> MapSurfaces | None:
        """The map that a frame lies in; None where the twin is no map of the drive's own scans.

        Args:
            static: the frame's static world, relative to `twin/`, where the drive has several.

        Raises:
            FormatError: the file is damaged.
        """
        if self._drive is None:
            return None
        file = surfel_file(self._drive.root, static)
        if file not in self._read:
            self._read[file] = MapSurfaces.read(file, self._settings)
        return self._read[file]


@dataclass(frozen=True, eq=False)
class MapSurfaces(SurfelMap):
    """The m surfaces of a map, and what they tell of beams.

    Attributes:
        settings: numbers that decide.
    """

    settings: Sampling

    @classmethod
    def read(cls, file: Path, settings: Sampling) -> MapSurfaces:
        """Those of a file.

        Raises:
            FormatError: the file is damaged.
        """
        return cls(**vars(read_surfels(file)), settings=settings)

    @cached_property
    def judge(self) -> np.ndarray:
        """(m,) bool: those in squares of the ground by whose surfaces findings are judged, the others being fitted."""
        square = np.floor(self.centre[:, :2] / self.settings.place_m).astype(int)
        return (square[:, 0] + square[:, 1]) % self.settings.judge_every == 0

    def met(self, place: np.ndarray, instance: np.ndarray) -> np.ndarray:
        """Row (n,) of the surface that each beam meets; −1 where none.

        Args:
            place: (n, 3) world places of the hits; anything where there are none.
            instance: (n,) what is hit, −1 the static world.
        """
        found = np.full(len(place), -1)
        rows = np.flatnonzero(instance == STATIC)
        found[rows] = self.rows_at(place[rows], self.settings.on_plane_m, self.settings.neighbours)
        return found

    def compared(
        self, met: np.ndarray, place: np.ndarray, slope: np.ndarray, measured: np.ndarray, moved: np.ndarray
    ) -> np.ndarray:
        """Which beams may be compared, (n,) bool: those that return from about the surface, or would if moved in part.

        They meet it among the points that it was made of: a beam beside them that is lost may never have met anything.
        About it is what a wrong range explains, and a little more across it: what returns from a kerb or a wheel is
        hardly off the ground, however far from where a beam that grazes the ground would meet that.

        Args:
            met: (n,) rows of the surfaces that beams meet.
            place: (n, 3) world places at which they do.
            slope: (n,) cosines of incidence.
            measured: (n, 3) world places of their returns; NaN where a beam has none.
            moved: (n, 3) how the sensor moved until the beam was fired, as far as the model does not say so [m].
        """
        row, by = np.maximum(met, 0), self.settings
        off = np.einsum("ij,ij->i", measured - self.centre[row], self.normal[row])
        both = np.stack([off, off + np.einsum("ij,ij->i", moved, self.normal[row])])
        away = np.where(np.sign(both[0]) == np.sign(both[1]), np.abs(both).min(0), 0.0)
        about = by.margin_m * slope + by.across_m + by.across_sigmas * self.sd_m[row]
        found = (met >= 0) & self.trusted[row] & ~(away > about)
        rows = np.flatnonzero(found)
        found[rows] = self.among_points(row[rows], place[rows])
        return found

    @cached_property
    def rough_m(self) -> np.ndarray:
        """(m,) standard deviation of the surfaces themselves: what the noise of ranges does not explain of theirs."""
        return self.roughness(self.settings.least_rough)

    def unsure_m(self, met: np.ndarray, slope: np.ndarray, grazing: float) -> np.ndarray:
        """(n,) float32 standard deviation of ranges to rough surfaces.

        Args:
            met: (n,) rows of the surfaces that beams meet.
            slope: (n,) cosines of incidence; `grazing` at least.
        """
        rough = np.where(met >= 0, self.rough_m[np.maximum(met, 0)], 0.0)
        return (rough / np.maximum(slope, grazing)).astype(np.float32)

    def drawn(self, looks: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Rows of surfaces with `count` looks in all, half of them on what lies flat, half on the rest where it is.

        Rather those that were looked at from near and far: with chances as the logarithms of their ranges' ratios.

        Args:
            looks: (m,) that each has; those with fewer than two tell nothing.
            count: of looks.
            rng: for the draw.
        """
        worth = np.log(np.maximum(self.range_m[:, 1], 1.0) / np.maximum(self.range_m[:, 0], 0.5))
        worth = np.where(looks > 1, np.maximum(worth, 1e-3), 0.0)
        keys = np.where(worth > 0, rng.random(len(worth)) ** (1 / np.maximum(worth, 1e-3)), -1.0)
        order = np.argsort(-keys, kind="stable")[: np.count_nonzero(worth)]
        flat = np.abs(self.normal[order, 2]) > self.settings.level
        share = np.where(flat, *(_share_before(looks[order], mine, count / 2) for mine in (flat, ~flat)))
        order = order[np.argsort(share, kind="stable")]
        return order[np.cumsum(looks[order]) <= count]


def _share_before(looks: np.ndarray, mine: np.ndarray, count: float) -> np.ndarray:
    """(m,) looks of some surfaces up to each, as a share of a count."""
    return np.cumsum(np.where(mine, looks, 0)) / count
