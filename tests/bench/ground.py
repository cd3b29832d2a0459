"""Unevenness of the ground, simulated and real: `python -m tests.bench.ground DRIVE... [--real DIR] [--frames FILE]`.

Ground is identified as in scans without labels: square cells whose points are all low and within a kerb and a half of
a plane. Two figures, each as quartiles and ninth decile over places: the scatter of a cell's points about its plane,
by range; and, along single rings, where no laser's calibration enters, second differences of height, whose growth with
the lag is the ground's spectrum.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Drive, Frame

CELLS_M = (1.0, 2.0)
REACH_EDGES_M = (5.0, 10.0, 15.0, 20.0)
LAGS_M = (0.25, 0.5, 1.0, 2.0, 4.0)
_SHARES = (25, 50, 75, 90)
_MOUNT_M, _STEEPEST, _KERB_M = 1.73, 0.06, 0.20
_FEWEST, _NARROWEST_M = 10, 0.15  # points of a cell; their spread in the direction where it is least


def scatter_about_planes(points: np.ndarray, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Distance (k,) from the sensor and scatter (k,) about its plane of every cell of ground, metres.

    Args:
        points: (n, 3) of one scan, sensor axes.
        cell_m: side of a cell.
    """
    near = np.hypot(points[:, 0], points[:, 1]) < REACH_EDGES_M[-1] + cell_m
    points = points[near].astype(np.float64)
    keys = np.floor(points[:, :2] / cell_m).astype(np.int64)
    _, cell = np.unique(keys[:, 0] * 100_000 + keys[:, 1], return_inverse=True)
    count = np.bincount(cell).astype(float)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(cell, values) / count

    middle = np.column_stack([mean(points[:, k]) for k in range(3)])
    x, y, z = (points - middle[cell]).T
    xx, xy, yy, xz, yz, zz = (mean(a * b) for a, b in ((x, x), (x, y), (y, y), (x, z), (y, z), (z, z)))
    determinant = np.maximum(xx * yy - xy**2, 1e-12)
    a, b = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
    scatter = np.sqrt(np.maximum(zz - a * xz - b * yz, 0) * count / np.maximum(count - 3, 1))
    residual = np.abs(z - a[cell] * x - b[cell] * y)
    largest = np.zeros(len(count))
    np.maximum.at(largest, cell, residual)
    narrow = (xx + yy) / 2 - np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
    distance = np.hypot(middle[:, 0], middle[:, 1])
    ground = (count >= _FEWEST) & (narrow > _NARROWEST_M**2) & (largest < _KERB_M)
    ground &= (middle[:, 2] < -_MOUNT_M + 0.3 + _STEEPEST * distance) & (np.hypot(a, b) < 2 * _STEEPEST)
    return distance[ground], scatter[ground]


def second_differences(frame: Frame, lag_m: float) -> np.ndarray:
    """z(s − lag) − 2 z(s) + z(s + lag), (k,) [m], of ground points along each ring, 5 to 12 m away."""
    ring, azimuth, points = frame.rays.ring, frame.rays.azimuth, frame.points[:, :3].astype(np.float64)
    order = np.lexsort((azimuth, ring))
    ring, points = ring[order], points[order]
    reach = np.hypot(points[:, 0], points[:, 1])
    low = (points[:, 2] < -_MOUNT_M + 0.3 + _STEEPEST * reach) & (reach > REACH_EDGES_M[0]) & (reach < 12.0)
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    joined = (np.diff(ring) == 0) & low[1:] & low[:-1] & (step < 0.12) & (np.abs(np.diff(points[:, 2])) < 0.05)
    along = np.concatenate([[0.0], np.cumsum(step)])
    run = np.concatenate([[0], np.cumsum(~joined)])
    before, behind = np.searchsorted(along, along - lag_m), np.searchsorted(along, along + lag_m)
    whole = (behind < len(along)) & (along > lag_m)
    rows = np.flatnonzero(whole)
    whole[rows] = (run[before[rows]] == run[rows]) & (run[behind[rows]] == run[rows])
    at, z = along[whole], points[:, 2]
    return np.interp(at - lag_m, along, z) - 2 * z[whole] + np.interp(at + lag_m, along, z)


def table(title: str, frames: Iterable[Frame]) -> list[str]:
    """Lines: quartiles and the ninth decile of scatter by cell and range, and of second differences by lag, in mm."""
    cells: dict[float, list[tuple[np.ndarray, np.ndarray]]] = {cell: [] for cell in CELLS_M}
    lags: dict[float, list[np.ndarray]] = {lag: [] for lag in LAGS_M}
    for frame in frames:
        for cell, found in cells.items():
            found.append(scatter_about_planes(frame.points[:, :3], cell))
        for lag, differences in lags.items():
            differences.append(np.abs(second_differences(frame, lag)))
    lines = [title]
    for cell, found in cells.items():
        distance, scatter = (np.concatenate(column) for column in zip(*found, strict=True))
        for low, high in pairwise(REACH_EDGES_M):
            part = scatter[(distance >= low) & (distance < high)]
            if len(part):
                lines.append(_line(f"planes of {cell:.0f} m, {low:.0f}–{high:.0f} m", part))
    for lag, differences in lags.items():
        everything = np.concatenate(differences)
        if len(everything):
            lines.append(_line(f"second differences, lag {lag:.2f} m", everything))
    return lines


def _line(what: str, values_m: np.ndarray) -> str:
    figures = "  ".join(f"{1000 * value:5.1f}" for value in np.percentile(values_m, _SHARES))
    return f"  {what:34s} {figures} mm   ({len(values_m)})"


def main() -> None:
    """Print a table a drive."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drives", nargs="*", type=Path)
    parser.add_argument("--real", type=Path, help="a folder in KITTI's layout")
    parser.add_argument("--frames", type=Path, help="names of its frames, one a line")
    parser.add_argument("--count", type=int, default=60, help="frames of each drive, evenly spread")
    options = parser.parse_args()
    if options.real is not None:
        names = set(options.frames.read_text().split()) if options.frames else None
        wanted = (frame for frame in Drive(options.real) if names is None or frame.name in names)
        print("\n".join(table(str(options.real), wanted)))
    for path in options.drives:
        frames = list(Drive(path))
        print("\n".join(table(str(path), frames[:: max(1, len(frames) // options.count)])))


if __name__ == "__main__":
    main()
