"""A file a scan: raw floats, NumPy, PCD, PLY, Feather.

PCD: pointclouds.org, The PCD file format, 0.7. Raw floats are those of KITTI (Geiger et al., IJRR 2013: x y z
reflectance), nuScenes (`.pcd.bin`: x y z intensity ring) and of tables like them.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import numpy as np

from cosim.drives.files import read_bytes
from cosim.recordings.fields import Columns, unnamed
from cosim.recordings.libraries import needed
from cosim.recordings.reading.source import Source
from cosim.recordings.scan import RecordingError

_WIDTHS = (4, 5, 6, 3)  # floats a point, the likeliest first
_CUT = "the file is cut off, damaged or no scan: copy it again, or choose the scans with --scans"


def suffix_of(path: Path) -> str:
    """Which reader a file wants: its last suffix, or `.pcd.bin`; empty where there is none for it."""
    name = path.name.lower()
    return next((suffix for suffix in SUFFIXES if name.endswith(suffix)), "")


def file_sources(files: Iterable[Path]) -> tuple[Source, ...]:
    """Scans of files, in the order given."""
    return tuple(Source(_stem(file), partial(read_columns, file)) for file in files)


def read_columns(path: Path) -> Columns:
    """The columns of a file.

    Raises:
        RecordingError: it is of no known format, cut off, or not what its suffix says.
        FormatError: it cannot be read at all.
    """
    reader = SUFFIXES.get(suffix_of(path))
    if reader is None:
        raise RecordingError(f"{path}: no reader for {path.suffix or 'such files'}; scans are {', '.join(SUFFIXES)}")
    data = read_bytes(path)
    try:
        return reader(data, str(path))
    except RecordingError:
        raise
    except Exception as error:  # noqa: BLE001 - parsers raise whatever they meet in a damaged file
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise RecordingError(f"{path}: not readable as {suffix_of(path)} ({reason}); {_CUT}") from None


def _stem(file: Path) -> str:
    return file.name[: -len(suffix_of(file))] or file.stem


def _raw(data: bytes, source: str, widths: tuple[int, ...] = _WIDTHS) -> Columns:
    """Float32 rows, of the first width for which all columns behind x y z are at least 0, as none of a wrong one is."""
    if not data:
        return unnamed(np.zeros((0, 4), np.float32), source)
    fitting = [width for width in widths if len(data) % (4 * width) == 0]
    for width in fitting:
        rows = np.frombuffer(data, "<f4").reshape(-1, width)
        with np.errstate(invalid="ignore"):
            if not (rows[:, 3:] < 0).any() and float(np.nanmax(np.abs(rows[:, :3]), initial=0.0)) < 1e4:
                return unnamed(rows, source)
    if not fitting:
        known = " or ".join(str(width) for width in sorted(widths))
        raise RecordingError(f"{source}: {len(data)} bytes are no rows of {known} float32; {_CUT}")
    raise RecordingError(
        f"{source}: no rows of {' or '.join(map(str, sorted(fitting)))} float32 make sense as x y z intensity …; "
        "write the scans as .npz with named arrays"
    )


def _numpy(data: bytes, source: str) -> Columns:
    loaded = np.load(io.BytesIO(data), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return _table(loaded, source)
    arrays = {name: loaded[name] for name in loaded.files}
    if "x" in {name.lower() for name in arrays}:
        return arrays
    tables = [name for name, values in arrays.items() if values.ndim == 2 and 3 <= values.shape[1] <= 6]
    if len(tables) != 1:
        raise RecordingError(
            f"{source}: arrays {', '.join(arrays) or 'none'}; give x, y, z …, or one table of 3 to 6 columns"
        )
    rest = {name: values for name, values in arrays.items() if values.shape == (len(arrays[tables[0]]),)}
    return {**_table(arrays[tables[0]], source), **rest}


def _table(rows: np.ndarray, source: str) -> Columns:
    if rows.dtype.names:
        return {name: rows[name] for name in rows.dtype.names}
    if rows.ndim != 2:
        raise RecordingError(f"{source}: an array of shape {rows.shape}; a scan is (n, 3 to 6) or has named fields")
    return unnamed(rows, source)


def _pcd(data: bytes, source: str) -> Columns:
    cloud = needed("pypcd4", "PCD").PointCloud.from_fileobj(io.BytesIO(data))
    if len(cloud.pc_data) != cloud.metadata.points:
        raise RecordingError(f"{source}: {len(cloud.pc_data)} points of {cloud.metadata.points}; {_CUT}")
    return {name: cloud.pc_data[name] for name in cloud.fields if cloud.pc_data[name].ndim == 1}


def _ply(data: bytes, source: str) -> Columns:
    import trimesh  # slow to import

    loaded = trimesh.load(io.BytesIO(data), file_type="ply", process=False)
    vertex = loaded.metadata["_ply_raw"]["vertex"]
    held = vertex["data"]
    if isinstance(held, dict):  # as text files are kept
        return {name: np.asarray(values).reshape(-1) for name, values in held.items()}
    if len(held) != vertex["length"]:
        raise RecordingError(f"{source}: {len(held)} points of {vertex['length']}; {_CUT}")
    return {name: held[name] for name in held.dtype.names}


def _feather(data: bytes, source: str) -> Columns:
    table = needed("pyarrow.feather", "Feather").read_table(io.BytesIO(data))
    return {name: table[name].to_numpy() for name in table.column_names}


def _five(data: bytes, source: str) -> Columns:
    return _raw(data, source, (5,))


SUFFIXES: dict[str, Callable[[bytes, str], Columns]] = {
    ".pcd.bin": _five,
    ".bin": _raw,
    ".npy": _numpy,
    ".npz": _numpy,
    ".pcd": _pcd,
    ".ply": _ply,
    ".feather": _feather,
}
