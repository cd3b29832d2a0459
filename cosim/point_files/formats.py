"""From the bytes of a point file to its columns: raw numbers, NumPy, PCD, PLY, Feather.

Raw numbers are those of KITTI (Geiger et al., IJRR 2013: x y z reflectance), nuScenes (`.pcd.bin`: x y z intensity
ring) and of tables like them; `raw.py` finds their layout. Columns without a name are called `column 1`, `column 2`, ….
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cosim.drives.files import read_bytes
from cosim.errors import CosimError
from cosim.point_files.cloud import Columns
from cosim.point_files.options import PointOptions
from cosim.point_files.pcd import read_pcd
from cosim.point_files.raw import RowLayout, find_row_layout
from cosim.point_files.scan import PointFileError

_RAW = (".pcd.bin", ".bin")
_SAMPLES = 5  # files used to infer the layout


@dataclass(frozen=True)
class PointReader:
    """Reads the columns of the point files of one sensor.

    Attributes:
        layout: of files of raw numbers.
    """

    layout: RowLayout = field(default_factory=RowLayout)

    def read(self, path: Path) -> Columns:
        """The columns of a file, (n,) each.

        Raises:
            PointFileError: no known format, shorter than its header says, or not what its suffix says.
            FormatError: it cannot be read at all.
        """
        suffix = suffix_of(path)
        if not suffix:
            raise PointFileError(
                f"{path}: no reader for {path.suffix or 'such files'}; scans are {', '.join(SUFFIXES)}"
            )
        return self.decode(read_bytes(path), str(path), suffix)

    def decode(self, data: bytes, source: str, suffix: str = ".bin") -> Columns:
        """The columns of a file's content; see `read`."""
        if suffix in _RAW:
            return unnamed(self.layout.rows(data, source))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return SUFFIXES[suffix](data, source)
        except CosimError:
            raise
        except Exception as error:  # noqa: BLE001 - parsers raise whatever they meet in a file that is not as it should be
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
            raise PointFileError(
                f"{source}: not readable as {suffix}: its parser says {reason}; the file may be cut off or of another "
                "format: compare its size with the original, or choose the scans with --scans"
            ) from None


def suffix_of(path: Path) -> str:
    """The suffix that chooses the reader: the last one, or `.pcd.bin`; empty where there is no reader."""
    name = path.name.lower()
    return next((suffix for suffix in SUFFIXES if name.endswith(suffix)), "")


def point_reader(files: Sequence[Path], options: PointOptions | None = None) -> PointReader:
    """The reader of the files of one sensor; a few of them are read to find the layout of raw numbers.

    Raises:
        PointFileError: no layout fits, see `find_row_layout`.
        FormatError: a file cannot be read.
    """
    raw = [file for file in files if suffix_of(file) in _RAW]
    if not raw:
        return PointReader()
    rows = np.unique(np.linspace(0, len(raw) - 1, min(_SAMPLES, len(raw))).round().astype(int))
    source = str(raw[0]) if len(raw) == 1 else str(raw[0].parent)
    roles = options.roles if options else None
    return PointReader(find_row_layout([read_bytes(raw[row]) for row in rows], source, len(roles) if roles else None))


def unnamed(rows: np.ndarray) -> Columns:
    """Columns of a table (n, k) whose fields have no names."""
    return {f"column {number}": column for number, column in enumerate(rows.T, 1)}


def _numpy(data: bytes, source: str) -> Columns:
    loaded = np.load(io.BytesIO(data), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return _table(loaded, source)
    arrays = {name: loaded[name] for name in loaded.files}
    if "x" in {name.lower() for name in arrays}:
        lengths = {values.shape for values in arrays.values() if values.ndim == 1}
        length = max((shape[0] for shape in lengths), default=0)
        return {name: values for name, values in arrays.items() if values.shape == (length,)}
    tables = [name for name, values in arrays.items() if values.ndim == 2 and 3 <= values.shape[1] <= 12]
    if len(tables) != 1:
        raise PointFileError(
            f"{source}: arrays {', '.join(arrays) or 'none'}; give x, y, z …, or one table of 3 to 12 columns"
        )
    rest = {name: values for name, values in arrays.items() if values.shape == (len(arrays[tables[0]]),)}
    return {**_table(arrays[tables[0]], source), **rest}


def _table(rows: np.ndarray, source: str) -> Columns:
    if rows.dtype.names:
        return {name: rows[name] for name in rows.dtype.names if rows[name].ndim == 1}
    if rows.ndim != 2 or not 3 <= rows.shape[1] <= 12 or rows.dtype.kind not in "fiu":
        raise PointFileError(
            f"{source}: an array of {rows.dtype} of shape {rows.shape}; a scan is (n, 3 to 12) numbers or has named "
            f"fields"
        )
    return unnamed(rows)


def _ply(data: bytes, source: str) -> Columns:
    import trimesh  # slow to import

    loaded = trimesh.load(io.BytesIO(data), file_type="ply", process=False)
    vertex = loaded.metadata["_ply_raw"]["vertex"]
    stored = vertex["data"]
    if isinstance(stored, dict):  # as text files are kept
        return {name: np.asarray(values).reshape(-1) for name, values in stored.items()}
    if len(stored) != vertex["length"]:
        raise PointFileError(
            f"{source}: {len(stored)} points of {vertex['length']} that its header says: the file is cut off; copy it "
            f"again"
        )
    return {name: stored[name] for name in stored.dtype.names}


def _feather(data: bytes, source: str) -> Columns:
    from cosim.point_files.libraries import needed

    table = needed("polars", "Feather").read_ipc(io.BytesIO(data))
    return {name: table[name].to_numpy() for name in table.columns}


def _las(data: bytes, source: str) -> Columns:
    from cosim.point_files.libraries import needed

    cloud = needed("laspy", "LAS").read(io.BytesIO(data))
    columns = {axis: np.asarray(getattr(cloud, axis), np.float64) for axis in "xyz"}
    others = {"intensity": "intensity", "gps_time": "time", "ring": "ring"}
    present = set(cloud.point_format.dimension_names)
    return columns | {name: np.asarray(cloud[key]) for key, name in others.items() if key in present}


SUFFIXES: dict[str, Callable[[bytes, str], Columns]] = {
    ".pcd.bin": lambda data, source: PointReader().decode(data, source),
    ".bin": lambda data, source: PointReader().decode(data, source),
    ".npy": _numpy,
    ".npz": _numpy,
    ".pcd": read_pcd,
    ".ply": _ply,
    ".feather": _feather,
    ".las": _las,
    ".laz": _las,
}
