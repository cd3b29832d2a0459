"""Surfaces of a twin that is a map made of the drive's own scans: `twin/surfels.npz`.

Such a map says nothing of where its surfaces and scans stand: both were fitted to the very points that are to be
judged. So the place of every surface along its normal, its reflectance and the poses of scans are free, and what is
left to tell effects is what differs between looks at one surface. Beams are compared where they meet a surface of the
map and return from about it; a return from elsewhere is something that the map does not hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from cosim.drives.files import read_bytes
from cosim.drives.kitti import Drive
from cosim.errors import FormatError
from sensors.hits import STATIC
from sensors.npz import NpzError, npz_arrays

FILE = "twin/surfels.npz"
_ARRAYS = ("centre", "normal", "range_m")
_MARGIN_M = 0.3  # across a surface, within which a return is its
_ON_PLANE_M = 0.02
_NEIGHBOURS = 6


def is_own_map(drive: Drive) -> bool:
    """Whether a drive's twin is a map made of its own scans."""
    return (drive.root / FILE).is_file()


@dataclass(frozen=True, eq=False)
class MapSurfaces:
    """The m surfaces of a map.

    Attributes:
        centre: (m, 3) world places [m].
        normal: (m, 3) unit normals.
        range_m: (m, 2) nearest and farthest look.
        tree: of the centres.
    """

    centre: np.ndarray
    normal: np.ndarray
    range_m: np.ndarray
    tree: KDTree

    @classmethod
    def of(cls, drive: Drive) -> MapSurfaces | None:
        """Those of a drive; None where its twin is no map of its own scans.

        Raises:
            FormatError: the file is damaged.
        """
        file = drive.root / FILE
        if not file.is_file():
            return None
        try:
            found = npz_arrays(read_bytes(file))
        except NpzError as error:
            raise FormatError(f"{file}: {error}; make the twin anew with `cosim twin`") from None
        missing = [name for name in _ARRAYS if name not in found]
        if missing:
            raise FormatError(f"{file}: lacks {', '.join(missing)}; make the twin anew with `cosim twin`")
        centre, normal, range_m = (np.asarray(found[name], np.float64) for name in _ARRAYS)
        if not len(centre) or not centre.shape == normal.shape == (len(range_m), 3) or range_m.shape[1:] != (2,):
            raise FormatError(f"{file}: {len(centre)} centres, {len(normal)} normals; make the twin anew")
        return cls(centre, normal, range_m, KDTree(centre))

    def __len__(self) -> int:
        return len(self.centre)

    def met(self, place: np.ndarray, instance: np.ndarray) -> np.ndarray:
        """Row (n,) of the surface that each beam meets; −1 where none.

        Args:
            place: (n, 3) world places of the hits; anything where there are none.
            instance: (n,) what is hit, −1 the static world.
        """
        found = np.full(len(place), -1)
        rows = np.flatnonzero(instance == STATIC)
        if not len(rows):
            return found
        _, near = self.tree.query(place[rows], k=min(_NEIGHBOURS, len(self)))
        near = near.reshape(len(rows), -1)
        off = np.einsum("ikj,ikj->ik", place[rows][:, None] - self.centre[near], self.normal[near])
        on = np.abs(off) < _ON_PLANE_M
        best = on.argmax(1)  # the nearest of those whose plane it lies on
        found[rows] = np.where(on.any(1), near[np.arange(len(rows)), best], -1)
        return found

    def compared(self, met: np.ndarray, measured: np.ndarray) -> np.ndarray:
        """Which beams may be compared, (n,) bool.

        Args:
            met: (n,) rows of the surfaces that beams meet.
            measured: (n, 3) world places of their returns; NaN where a beam has none.
        """
        row = np.maximum(met, 0)
        off = np.einsum("ij,ij->i", measured - self.centre[row], self.normal[row])
        return (met >= 0) & ~(np.abs(off) > _MARGIN_M)

    def told(self) -> np.ndarray:
        """(m,) how much each tells by being looked at from near and far: logarithm of its ranges' ratio."""
        return np.log(np.maximum(self.range_m[:, 1], 1.0) / np.maximum(self.range_m[:, 0], 0.5))
