"""Surfaces of a twin that is a map of a drive's scans: `twin/surfels.npz`, or `twin/surfels/NAME.npz` of several."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from cosim.drives.files import read_bytes
from cosim.errors import FormatError
from sensors.npz import NpzError, npz_arrays

_FILE, _FOLDER = "twin/surfels.npz", "twin/surfels"
_SIDES = 8
_ARRAYS = {
    "centre": (3,), "normal": (3,), "reach_m": (_SIDES,), "sd_m": (), "range_m": (2,), "cos_incidence": (2,),
    "trusted": (),
}  # fmt: skip
_REFLECTANCE = "reflectance"  # need not be there
_CELL = "cell_m"
_MOST_CELLS = 1 << 20  # from the origin to the edge of what can be numbered


def has_surfels(root: Path) -> bool:
    """Whether a drive's twin is a map made of its own scans, or several."""
    return (root / _FILE).is_file() or (root / _FOLDER).is_dir()


def surfel_file(root: Path, static: str | None) -> Path:
    """The file of a frame's map.

    Args:
        root: of the drive.
        static: the frame's static world, relative to `twin/`, where the drive has several.
    """
    return root / (_FILE if static is None else f"{_FOLDER}/{Path(static).stem}.npz")


@dataclass(frozen=True, eq=False)
class SurfelMap:
    """The m surfaces of a map.

    Attributes:
        centre: (m, 3) world places [m].
        normal: (m, 3) unit normals.
        sd_m: (m,) standard deviation of its points about its plane.
        reach_m: (m, 8) how far points reach along `sides` of the normal.
        range_m: (m, 2) nearest and farthest look.
        cos_incidence: (m, 2) of these.
        reflectance: (m,) mean intensity of its points; 0 where it is unknown.
        trusted: (m,) bool: seen well, and with little else about them.
        cell_m: size of the cells, of which each holds one surface at most.
    """

    centre: np.ndarray
    normal: np.ndarray
    sd_m: np.ndarray
    reach_m: np.ndarray
    range_m: np.ndarray
    cos_incidence: np.ndarray
    reflectance: np.ndarray
    trusted: np.ndarray
    cell_m: float

    def __len__(self) -> int:
        return len(self.centre)

    def rows_at(self, position: np.ndarray, off_m: float, neighbours: int) -> np.ndarray:
        """Row (n,) of the surface that each place (n, 3) lies on; −1 where none.

        Args:
            position: world places.
            off_m: across a surface, within which a place lies on it.
            neighbours: nearest surfaces that are asked where that of the place's own cell is not it.
        """
        found = self._row_in_cell(position, off_m)
        rows = np.flatnonzero(found < 0)  # over the rim of a cell
        if len(rows):
            _, near = self._tree.query(position[rows], k=min(neighbours, len(self)))
            near = near.reshape(len(rows), -1)
            off = np.einsum("ikj,ikj->ik", position[rows][:, None] - self.centre[near], self.normal[near])
            on = np.abs(off) < off_m
            best = on.argmax(1)  # the nearest of those whose plane it lies on
            found[rows] = np.where(on.any(1), near[np.arange(len(rows)), best], -1)
        return found

    def among_points(self, row: np.ndarray, position: np.ndarray) -> np.ndarray:
        """(n,) bool: whether places (n, 3) lie among the points that the surfaces of some rows (n,) were made of."""
        rest, found = position - self.centre[row], np.ones(len(row), bool)
        for side in range(_SIDES):
            found &= np.einsum("ij,ij->i", rest, self._sides[row, side]) <= self.reach_m[row, side]
        return found

    def roughness(self, least: float) -> np.ndarray:
        """(m,) square root of sd² − σ²cos²; σ, of the noise of ranges, from how lower quartiles of sd² grow with cos².

        Args:
            least: share of sd that is left.
        """
        square, variance, noise = self.cos_incidence.mean(1) ** 2, self.sd_m**2, 0.0
        edges = np.quantile(square, np.linspace(0, 1, 9))
        slot = np.clip(np.searchsorted(edges, square, side="right") - 1, 0, 7)
        used = [slot == k for k in range(8) if np.count_nonzero(slot == k) >= 5]
        if len(used) > 2:
            lower = [float(np.quantile(variance[own], 0.25)) for own in used]
            noise = max(float(np.polyfit([float(np.mean(square[own])) for own in used], lower, 1)[0]), 0.0)
        return np.sqrt(np.maximum(variance - noise * square, least**2 * variance))

    def _row_in_cell(self, position: np.ndarray, off_m: float) -> np.ndarray:
        """Row (n,) of the surface in the cell of each place, if that lies on its plane; −1 elsewhere."""
        cells, order = self._cells
        cell = cell_keys(position, self.cell_m)
        at = np.minimum(np.searchsorted(cells, cell), len(self) - 1)
        row = order[at]
        off = np.einsum("ij,ij->i", position - self.centre[row], self.normal[row])
        return np.where((cells[at] == cell) & (np.abs(off) < off_m), row, -1)

    @cached_property
    def _cells(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (m,) of the surfaces' cells, rising, and the rows (m,) of the surfaces in them."""
        cells = cell_keys(self.centre, self.cell_m)
        order = np.argsort(cells, kind="stable")
        return cells[order], order

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.centre)

    @cached_property
    def _sides(self) -> np.ndarray:
        return sides(self.normal)


def read_surfels(file: Path) -> SurfelMap:
    """The map of a file.

    Raises:
        FormatError: the file is damaged.
    """
    try:
        found = npz_arrays(read_bytes(file))
    except NpzError as error:
        raise FormatError(f"{file}: {error}; make the twin again with `cosim twin`") from None
    missing = [name for name in (*_ARRAYS, _CELL) if name not in found]
    if missing:
        raise FormatError(f"{file}: missing {', '.join(missing)}; make the twin again with `cosim twin`")
    arrays = {name: np.asarray(found[name], np.float64) for name in _ARRAYS}
    count = len(arrays["centre"])
    arrays[_REFLECTANCE] = np.asarray(found.get(_REFLECTANCE, np.zeros(count)), np.float64)
    odd = [name for name, shape in {**_ARRAYS, _REFLECTANCE: ()}.items() if arrays[name].shape != (count, *shape)]
    if not count or odd:
        raise FormatError(
            f"{file}: {odd[0] if odd else 'centre'} does not have one row per surface; make the twin again"
        )
    if found[_CELL].shape != (1,) or not found[_CELL][0] > 0:
        raise FormatError(f"{file}: {_CELL} is not a valid cell size; make the twin again with `cosim twin`")
    trusted = arrays.pop("trusted") > 0
    return SurfelMap(**arrays, trusted=trusted, cell_m=float(found[_CELL][0]))


def sides(normal: np.ndarray) -> np.ndarray:
    """Eight directions (m, 8, 3), evenly about, in planes of unit normals (m, 3)."""
    aside = np.cross(normal, np.eye(3)[np.abs(normal).argmin(1)])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    upward = np.cross(normal, aside)
    turn = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)[:, None]
    return np.cos(turn) * aside[:, None] + np.sin(turn) * upward[:, None]


def cell_keys(xyz: np.ndarray, cell_m: float) -> np.ndarray:
    """Numbers of the cells of places (n, 3), (n,) int64."""
    cell = np.floor(np.asarray(xyz, np.float64) / cell_m).astype(np.int64) + _MOST_CELLS
    return (cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2]
