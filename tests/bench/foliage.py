"""How points of vegetation scatter, ours beside real: `python -m tests.bench.foliage DRIVE... --real DIR`.

Vegetation is told as it is in scans without labels: what stands 1 m and more above the ground, 6 to 30 m away, and is
scattered among its 16 nearest neighbours in all directions (least over greatest eigenvalue of their covariance above
0.08; Lalonde et al., Natural terrain classification, Journal of Field Robotics 23, 2006).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from cosim.drives.kitti import Drive

_NEIGHBOURS, _SCATTERED = 16, 0.08
_LOW_M, _HIGH_M, _NEAR_M, _FAR_M = -0.6, 6.0, 6.0, 30.0  # heights from the sensor, 1.7 m above the ground


def scatter_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which upright points (n, ≥ 3) are scattered, (k,) bool, and how far ranges differ about each, (k,) [m]."""
    distance = np.linalg.norm(points[:, :3], axis=1)
    near = (distance > _NEAR_M) & (distance < _FAR_M)
    upright = points[near & (points[:, 2] > _LOW_M) & (points[:, 2] < _HIGH_M), :3]
    if len(upright) < _NEIGHBOURS:
        return np.zeros(0, bool), np.zeros(0)
    _, rows = KDTree(upright).query(upright, k=_NEIGHBOURS)
    about = upright[rows] - upright[rows].mean(1, keepdims=True)
    spread = np.linalg.eigvalsh(np.einsum("nki,nkj->nij", about, about) / _NEIGHBOURS)
    return spread[:, 0] > _SCATTERED * spread[:, 2], np.linalg.norm(upright, axis=1)[rows].std(1)


def row(path: Path) -> str:
    """One line of the table: shares and quartiles over all frames of a drive."""
    found = [scatter_of(frame.points) for frame in Drive(path)]
    scattered, spread = (np.concatenate(column) for column in zip(*found, strict=True))
    low, middle, high = np.percentile(spread[scattered], [25, 50, 75]) * 100
    return (
        f"{path.name:24s} {scattered.mean():6.1%} scattered   ranges about them {low:.1f}  {middle:.1f}  {high:.1f} cm"
    )


def main() -> None:
    """Print a line a drive."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drives", nargs="*", type=Path)
    parser.add_argument("--real", type=Path, required=True, help="a folder in KITTI's layout")
    options = parser.parse_args()
    for path in (options.real, *options.drives):
        print(row(path))


if __name__ == "__main__":
    main()
