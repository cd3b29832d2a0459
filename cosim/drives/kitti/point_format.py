"""Layout of a drive's scans: as `cosim run` writes them, or inferred from the files of a measured drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.drives.files import read_bytes
from cosim.drives.kitti.points import decode_points
from cosim.errors import DriveError, FormatError
from cosim.point_files.formats import PointReader, unnamed
from cosim.point_files.options import PointOptions
from cosim.point_files.raw import RowLayout, find_row_layout
from cosim.point_files.schema import PointSchema, decode_scan, find_schema

_SAMPLES = 3  # scans that are read to find the layout
_LIMITS = {3: "x,y,z", 4: "x,y,z,intensity"}  # what a number of columns means without a word more
_MOST_COLUMNS = 12
OPTIONS = ("columns", "intensity_scale", "axes", "flip_y", "metres")  # keys of drive.yaml


@dataclass(frozen=True, eq=False)
class StoredScan:
    """The points of one file.

    Attributes:
        points: (n, 4) float32 x, y, z [m] in LiDAR axes and intensity in 0–1.
        is_used: (m,) bool: rows of the file that are points.
        left_out: number of the other rows, by reason.
    """

    points: np.ndarray
    is_used: np.ndarray
    left_out: Mapping[str, int]


@dataclass(frozen=True, eq=False)
class PointFormat:
    """The layout of a drive's scans and the meaning of their columns.

    Attributes:
        layout: of the rows.
        schema: meaning of the columns; None for the format that `cosim` writes, of which nothing is to infer.
    """

    layout: RowLayout
    schema: PointSchema | None = None

    @property
    def has_intensity(self) -> bool:
        """Whether a column holds intensities."""
        return self.schema is None or "intensity" in self.schema.names

    def read(self, path: Path) -> StoredScan:
        """The points of a file.

        Raises:
            FormatError: it cannot be read, or ends within a point.
        """
        data = read_bytes(path)
        if self.schema is None:
            points, finite = decode_points(data, path)
            bad = int((~finite).sum())
            return StoredScan(points, finite, {"not finite": bad} if bad else {})
        scan, used = decode_scan(unnamed(self.layout.rows(data, str(path))), str(path), self.schema)
        intensity = np.zeros(len(scan), np.float32) if scan.intensity is None else scan.intensity
        return StoredScan(np.column_stack([scan.xyz, intensity]).astype(np.float32), used, scan.left_out)


#: The format of KITTI and of `cosim run`: x, y, z, intensity in float32.
PLAIN = PointFormat(RowLayout())


def drive_options(info: Mapping[str, Any], where: Path) -> tuple[PointOptions, int | None]:
    """Statements of `drive.yaml` about its scans, and the number of columns if it states only that.

    Raises:
        DriveError: a value is of another kind.
    """
    columns, width = info.get("columns"), None
    if isinstance(columns, list) and all(isinstance(word, str) for word in columns):
        columns = ",".join(columns)
    if isinstance(columns, int) and not isinstance(columns, bool) and 3 <= columns <= _MOST_COLUMNS:
        width, columns = columns, _LIMITS.get(columns)
    if columns is not None and not isinstance(columns, str):
        raise DriveError(
            f"{where}: columns is {info['columns']!r}; give a number, 4 (x y z intensity) or 3 (x y z), or their "
            "names, as [x, y, z, intensity, _]"
        )
    scale, metres = (info.get(key) for key in ("intensity_scale", "metres"))
    for key, value in (("intensity_scale", scale), ("metres", metres)):
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise DriveError(f"{where}: {key} is {value!r}; give a number")
    axes, flip_y = info.get("axes"), info.get("flip_y", False)
    if not isinstance(flip_y, bool) or not (axes is None or isinstance(axes, str)):
        raise DriveError(f"{where}: axes is {axes!r} and flip_y {flip_y!r}; give x,-y,z or its like, and true or false")
    try:
        return PointOptions(columns, scale, axes, flip_y, metres), width
    except FormatError as error:
        raise DriveError(f"{where}: {error}") from None


def find_point_format(files: Sequence[Path], info: Mapping[str, Any], where: Path) -> PointFormat:
    """The format of a measured drive's scans, from a few of them.

    Args:
        files: its scans.
        info: content of `drive.yaml`.
        where: path of that, for messages.

    Raises:
        DriveError: `drive.yaml` states what cannot be.
        FormatError: no layout fits, or two clues contradict each other.
    """
    options, width = drive_options(info, where)
    rows = np.unique(np.linspace(0, len(files) - 1, min(_SAMPLES, len(files))).round().astype(int))
    samples = {files[row]: read_bytes(files[row]) for row in rows}
    folder = str(files[0]) if len(files) == 1 else str(files[0].parent)
    roles = options.roles
    layout = find_row_layout(list(samples.values()), folder, len(roles) if roles else width)
    reader = PointReader(layout)
    whole = [reader.decode(data, str(file)) for file, data in samples.items() if not len(data) % layout.row_bytes]
    if not any(len(column) for columns in whole for column in columns.values()):
        return PointFormat(layout, PointSchema(names=_usual_names(layout)))
    return PointFormat(layout, find_schema(whole, options, folder))


def _usual_names(layout: RowLayout) -> dict[str, str]:
    roles = ("x", "y", "z", "intensity")[: layout.columns]
    return {role: f"column {number}" for number, role in enumerate(roles, 1)}
