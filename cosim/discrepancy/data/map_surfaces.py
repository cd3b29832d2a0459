"""Surfaces of a twin that is a map made of the drive's own scans: `twin/surfels.npz`, or `twin/surfels/` of several.

The positions of surfaces and scans in such a map are fitted to the same points that the model is compared with. They
contain no independent information. So the position of each surface along its normal, its reflectance and the poses of
the scans have flat priors, and effects are identified only from differences between repeated observations of a surface.
A beam is compared if it hits a surface of the map and its return is close to it; other returns are from something that
is not in the map.
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
    """Reads and caches the maps made from a drive's scans.

    Args:
        drive: drive whose twin may be a map.
        settings: settings of the sampling.
    """

    def __init__(self, drive: Drive, settings: Sampling = DEFAULT.sampling) -> None:
        self._settings = settings
        self._drive = drive if has_surfels(drive.root) else None
        self._read: dict[Path, MapSurfaces] = {}

    def of(self, static: str | None) -> MapSurfaces | None:
        """Return the map that a frame is in, or None if the twin is not a map made from the drive's scans.

        Args:
            static: path of the frame's static world relative to `twin/` if the drive has several.

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
    """The m surfaces (surfels) of a map, assigned to beams.

    Attributes:
        settings: settings of the sampling.
    """

    settings: Sampling

    @classmethod
    def read(cls, file: Path, settings: Sampling) -> MapSurfaces:
        """Read the surfaces of a file.

        Raises:
            FormatError: the file is damaged.
        """
        return cls(**vars(read_surfels(file)), settings=settings)

    def met(self, position: np.ndarray, instance: np.ndarray) -> np.ndarray:
        """Row (n,) of the surface that each beam hits; −1 for none.

        Args:
            position: (n, 3) world points of the hits [m]; arbitrary for misses.
            instance: (n,) instance that is hit, −1 for the static world.
        """
        surface = np.full(len(position), -1)
        rows = np.flatnonzero(instance == STATIC)
        surface[rows] = self.rows_at(position[rows], self.settings.on_plane_m, self.settings.neighbours)
        return surface

    def compared(
        self, met: np.ndarray, position: np.ndarray, slope: np.ndarray, measured: np.ndarray, moved: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mask (n,) of beams that can be compared: no return, or a return close to the surface with or without `moved`.

        Other returns are from something that is not in the map, which also stops beams that do not return.

        The hit must lie among the points that the surface was made from; a dropped beam outside of them may not have
        hit anything. The tolerance along the normal is a range error plus a small margin: a return from a kerb or a
        wheel is close to the ground even if, at grazing incidence, its range differs a lot.

        Args:
            met: (n,) rows of the surfaces that are hit.
            position: (n, 3) world points of the hits [m].
            slope: (n,) cosines of incidence.
            measured: (n, 3) world points of the returns [m]; NaN without a return.
            moved: (n, 3) motion of the sensor until the beam was fired that the model does not include [m].

        Returns:
            The mask; and a mask (n,) of beams that should hit a surface but return from something else.
        """
        row, by = np.maximum(met, 0), self.settings
        offset = np.einsum("ij,ij->i", measured - self.centre[row], self.normal[row])
        offsets = np.stack([offset, offset + np.einsum("ij,ij->i", moved, self.normal[row])])
        distance = np.where(np.sign(offsets[0]) == np.sign(offsets[1]), np.abs(offsets).min(0), 0.0)
        tolerance = by.margin_m * slope + by.across_m + by.across_sigmas * self.sd_m[row]
        mask = (met >= 0) & self.trusted[row]
        rows = np.flatnonzero(mask)
        mask[rows] = self.among_points(row[rows], position[rows])
        far = distance > tolerance
        return mask & ~far, mask & far

    @cached_property
    def rough_m(self) -> np.ndarray:
        """(m,) roughness σ [m] of the surfaces: the part of their points' scatter that range noise does not explain."""
        return self.roughness(self.settings.least_rough)

    def twin_sigma_m(self, met: np.ndarray, slope: np.ndarray, grazing: float) -> np.ndarray:
        """(n,) float32 σ of ranges due to roughness [m].

        Args:
            met: (n,) rows of the surfaces that are hit.
            slope: (n,) cosines of incidence.
            grazing: lower limit of the cosines.
        """
        rough = np.where(met >= 0, self.rough_m[np.maximum(met, 0)], 0.0)
        return (rough / np.maximum(slope, grazing)).astype(np.float32)

    def reflectances(self, met: np.ndarray) -> np.ndarray:
        """(n,) float32 measured reflectances of the surfaces (n,) that are hit; NaN where unknown."""
        values = self.reflectance[np.maximum(met, 0)]
        return np.where((met >= 0) & (values > 0), values, np.nan).astype(np.float32)

    def sample(self, observations: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Sample rows of surfaces with `count` observations in total, if possible half of them on horizontal surfaces.

        Sampling probabilities are proportional to the log ratio of the largest to the smallest range of observation.

        Args:
            observations: (m,) observations of each surface; surfaces with fewer than two are not sampled.
            count: total number of observations.
            rng: random generator.
        """
        log_ratio = np.log(np.maximum(self.range_m[:, 1], 1.0) / np.maximum(self.range_m[:, 0], 0.5))
        log_ratio = np.where(observations > 1, np.maximum(log_ratio, 1e-3), 0.0)
        keys = np.where(log_ratio > 0, rng.random(len(log_ratio)) ** (1 / np.maximum(log_ratio, 1e-3)), -1.0)
        order = np.argsort(-keys, kind="stable")[: np.count_nonzero(log_ratio)]
        is_flat = np.abs(self.normal[order, 2]) > self.settings.level
        rank = np.where(
            is_flat, *(_cumulative_share(observations[order], mask, count / 2) for mask in (is_flat, ~is_flat))
        )
        order = order[np.argsort(rank, kind="stable")]
        return order[np.cumsum(observations[order]) <= count]


def _cumulative_share(observations: np.ndarray, mask: np.ndarray, count: float) -> np.ndarray:
    """(m,) cumulative observations of the masked surfaces, relative to `count`."""
    return np.cumsum(np.where(mask, observations, 0)) / count
