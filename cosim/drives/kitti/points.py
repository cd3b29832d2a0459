"""Velodyne scans: `velodyne/NAME.bin`, float32 little-endian x y z intensity in LiDAR axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.drives.files import read_bytes
from cosim.errors import FormatError

POINT_COLUMNS = 4
POINT_BYTES = 4 * POINT_COLUMNS


def encode_points(points: np.ndarray) -> bytes:
    """The bytes of a `.bin` file.

    Args:
        points: (n, 4) x, y, z [m] in LiDAR axes and intensity 0–1; stored as float32.

    Raises:
        FormatError: the shape is not (n, 4), or a value is NaN or infinite.
    """
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] != 4:
        raise FormatError(f"points have shape {points.shape}; a scan is (n, 4): x, y, z, intensity")
    stored = np.ascontiguousarray(points, "<f4")
    bad = ~_finite_rows(stored)
    if bad.any():
        raise FormatError(_nonfinite("points", bad) + "; remove those returns before writing the scan")
    return stored.tobytes()


def decode_points(
    data: bytes, source: str | Path = "scan", columns: int = POINT_COLUMNS
) -> tuple[np.ndarray, np.ndarray]:
    """The points of a `.bin` file that may hold broken rows.

    Args:
        data: the content of the file.
        source: the name that errors mention.
        columns: floats a point: x, y, z, intensity; or 3 without intensity, which is then 0.

    Returns:
        The finite points, (n, 4) float32, and the mask (m,) bool of the stored rows that are finite, so
        that per-point arrays of the same frame can be filtered in the same way; `(~mask).sum()` rows were dropped.

    Raises:
        FormatError: the size is not a multiple of that of a point.
    """
    size = 4 * columns
    if len(data) % size:
        held = "x y z intensity" if columns == POINT_COLUMNS else "x y z"
        remedy = "the file is truncated or of another format: write it again"
        if columns == POINT_COLUMNS and len(data) % 12 == 0:
            remedy = "if it has only x y z, state `columns: 3` in drive.yaml; otherwise it is truncated: write it again"
        raise FormatError(f"{source}: {len(data)} bytes are not a multiple of {size} (float32 {held}); {remedy}")
    stored = np.frombuffer(data, "<f4").reshape(-1, columns)
    points = np.zeros((len(stored), POINT_COLUMNS), np.float32)
    points[:, :columns] = stored
    finite = _finite_rows(points)
    return (points if finite.all() else points[finite]), finite


def write_points(path: str | Path, points: np.ndarray) -> None:
    """Write a `.bin` file; see `encode_points`."""
    Path(path).write_bytes(encode_points(points))


def read_points(path: str | Path) -> np.ndarray:
    """The points of a `.bin` file, (n, 4) float32; an empty file is a scan without returns.

    Raises:
        FormatError: the file is missing, truncated, or holds NaN or infinity (`read_points_lenient`
            drops those rows and says which).
    """
    points, finite = read_points_lenient(path)
    if not finite.all():
        raise FormatError(f"{path}: " + _nonfinite("points", ~finite) + "; repair the scan")
    return points


def read_points_lenient(path: str | Path, columns: int = POINT_COLUMNS) -> tuple[np.ndarray, np.ndarray]:
    """The finite points of a `.bin` file and the mask of its finite rows; see `decode_points`."""
    return decode_points(read_bytes(path), path, columns)


def _finite_rows(points: np.ndarray) -> np.ndarray:
    finite = np.isfinite(points)
    return np.ones(len(points), bool) if finite.all() else np.asarray(finite.all(axis=1))  # rows are slow to reduce


def _nonfinite(what: str, bad: np.ndarray) -> str:
    return f"{int(bad.sum())} of {len(bad)} {what} hold NaN or infinity (first: row {int(bad.argmax())})"
