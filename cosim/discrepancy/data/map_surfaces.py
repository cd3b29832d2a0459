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

from cosim.discrepancy.settings import DEFAULT
from cosim.drives.files import read_bytes
from cosim.drives.kitti import Drive
from cosim.errors import FormatError
from sensors.hits import STATIC
from sensors.npz import NpzError, npz_arrays

FILE = "twin/surfels.npz"
_ARRAYS = {"centre": (3,), "normal": (3,), "sd_m": (), "range_m": (2,), "cos_incidence": (2,), "trusted": ()}
_MARGIN_M = 0.3  # across a surface, within which a return is its
_ON_PLANE_M = 0.02
_NEIGHBOURS = 6
_LEAST_ROUGH = 0.2  # of the scatter, that a surface has itself
_LEVEL = 0.9  # |n·z| of what lies flat


def is_own_map(drive: Drive) -> bool:
    """Whether a drive's twin is a map made of its own scans."""
    return (drive.root / FILE).is_file()


@dataclass(frozen=True, eq=False)
class MapSurfaces:
    """The m surfaces of a map.

    Attributes:
        centre: (m, 3) world places [m].
        normal: (m, 3) unit normals.
        rough_m: (m,) standard deviation of the surface itself about its plane: what scatter of points the noise of
            ranges does not explain.
        range_m: (m, 2) nearest and farthest look.
        trusted: (m,) bool: seen well, and with little else about them.
        tree: of the centres.
    """

    centre: np.ndarray
    normal: np.ndarray
    rough_m: np.ndarray
    range_m: np.ndarray
    trusted: np.ndarray
    tree: KDTree

    @classmethod
    def of(cls, drive: Drive) -> MapSurfaces | None:
        """Those of a drive; None where its twin is no map of its own scans.

        Raises:
            FormatError: the file is damaged.
        """
        if not is_own_map(drive):
            return None
        file = drive.root / FILE
        try:
            found = npz_arrays(read_bytes(file))
        except NpzError as error:
            raise FormatError(f"{file}: {error}; make the twin anew with `cosim twin`") from None
        missing = [name for name in _ARRAYS if name not in found]
        if missing:
            raise FormatError(f"{file}: lacks {', '.join(missing)}; make the twin anew with `cosim twin`")
        arrays = {name: np.asarray(found[name], np.float64) for name in _ARRAYS}
        count = len(arrays["centre"])
        odd = [name for name, shape in _ARRAYS.items() if arrays[name].shape != (count, *shape)]
        if not count or odd:
            raise FormatError(f"{file}: {odd[0] if odd else 'centre'} has no row a surface; make the twin anew")
        rough = _roughness(arrays["sd_m"], arrays["cos_incidence"].mean(1))
        return cls(
            arrays["centre"],
            arrays["normal"],
            rough,
            arrays["range_m"],
            arrays["trusted"] > 0,
            KDTree(arrays["centre"]),
        )

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
        return (met >= 0) & self.trusted[row] & ~(np.abs(off) > _MARGIN_M)

    def unsure_m(self, met: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """(n,) float32 standard deviation of ranges to rough surfaces.

        Args:
            met: (n,) rows of the surfaces that beams meet.
            slope: (n,) cosines of incidence.
        """
        rough = np.where(met >= 0, self.rough_m[np.maximum(met, 0)], 0.0)
        return (rough / np.maximum(slope, DEFAULT.grazing)).astype(np.float32)

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
        flat = np.abs(self.normal[order, 2]) > _LEVEL
        share = np.where(flat, *(_share_before(looks[order], mine, count / 2) for mine in (flat, ~flat)))
        order = order[np.argsort(share, kind="stable")]
        return order[np.cumsum(looks[order]) <= count]


def _share_before(looks: np.ndarray, mine: np.ndarray, count: float) -> np.ndarray:
    """(m,) looks of some surfaces up to each, as a share of a count."""
    return np.cumsum(np.where(mine, looks, 0)) / count


def _roughness(sd_m: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """(m,) square root of sd² − σ²cos²; σ, of the noise of ranges, from how lower quartiles of sd² grow with cos².

    Args:
        sd_m: (m,) scatter of points across the surfaces.
        slope: (m,) usual cosines of incidence.
    """
    edges = np.quantile(slope**2, np.linspace(0, 1, 9))
    slot = np.clip(np.searchsorted(edges, slope**2, side="right") - 1, 0, 7)
    used = [k for k in range(8) if np.count_nonzero(slot == k) >= 5]
    noise = 0.0
    if len(used) > 2:
        square = [float(np.quantile(sd_m[slot == k] ** 2, 0.25)) for k in used]
        noise = max(float(np.polyfit([float(np.mean(slope[slot == k] ** 2)) for k in used], square, 1)[0]), 0.0)
    return np.sqrt(np.maximum(sd_m**2 - noise * slope**2, (_LEAST_ROUGH * sd_m) ** 2))
