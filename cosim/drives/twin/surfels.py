"""Surfaces of a twin that is a map of a drive's scans: `twin/surfels.npz`, or `twin/surfels/NAME.npz` of several."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.drives.files import read_bytes
from cosim.errors import FormatError
from sensors.npz import NpzError, npz_arrays

_FILE, _FOLDER = "twin/surfels.npz", "twin/surfels"
_SIDES = 8
_ARRAYS = {
    "centre": (3,), "normal": (3,), "reach_m": (_SIDES,), "sd_m": (), "range_m": (2,), "cos_incidence": (2,),
    "trusted": (),
}  # fmt: skip
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


def read_surfels(file: Path) -> tuple[dict[str, np.ndarray], float]:
    """Arrays with a row for each of m surfaces, and the size of the cells, of which each holds one surface at most.

    `centre` and `normal` (m, 3), world axes; `reach_m` (m, 8) how far points reach along `sides`; `sd_m` (m,) their
    scatter across; `range_m` and `cos_incidence` (m, 2) of the nearest and farthest look; `trusted` (m,), above 0 where
    seen well, with little else about.

    Raises:
        FormatError: the file is damaged.
    """
    try:
        found = npz_arrays(read_bytes(file))
    except NpzError as error:
        raise FormatError(f"{file}: {error}; make the twin anew with `cosim twin`") from None
    missing = [name for name in (*_ARRAYS, _CELL) if name not in found]
    if missing:
        raise FormatError(f"{file}: lacks {', '.join(missing)}; make the twin anew with `cosim twin`")
    arrays = {name: np.asarray(found[name], np.float64) for name in _ARRAYS}
    count = len(arrays["centre"])
    odd = [name for name, shape in _ARRAYS.items() if arrays[name].shape != (count, *shape)]
    if not count or odd:
        raise FormatError(f"{file}: {odd[0] if odd else 'centre'} has no row a surface; make the twin anew")
    if found[_CELL].shape != (1,) or not found[_CELL][0] > 0:
        raise FormatError(f"{file}: {_CELL} is no size of cells; make the twin anew with `cosim twin`")
    return arrays, float(found[_CELL][0])


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
