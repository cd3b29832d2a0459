"""Scatter of points on vegetation, simulated and real: `python -m tests.bench.foliage DRIVE... [--real DIR]`.

Of simulated drives it also says which materials scatter, and how much of what is upright each is.

Vegetation is identified as in scans without labels: points 1 m or more above the ground, 6 to 30 m away, and
scattered among its 16 nearest neighbours in all directions (least over greatest eigenvalue of their covariance above
0.08; Lalonde et al., Natural terrain classification, Journal of Field Robotics 23, 2006).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from cosim.drives.kitti import Drive
from sensors.hits_file import load_hits
from sensors.pattern import load_pattern

_NEIGHBOURS, _SCATTERED = 16, 0.08
_LOW_M, _HIGH_M, _NEAR_M, _FAR_M = -0.6, 6.0, 6.0, 30.0  # heights from the sensor, 1.7 m above the ground


def upright_of(points: np.ndarray) -> np.ndarray:
    """(n,) bool: points (n, ≥ 3) 1 m or more above the ground at medium range."""
    distance = np.linalg.norm(points[:, :3], axis=1)
    near = (distance > _NEAR_M) & (distance < _FAR_M)
    return near & (points[:, 2] > _LOW_M) & (points[:, 2] < _HIGH_M)


def scatter_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which upright points (n, ≥ 3) are scattered, (k,) bool, and how far ranges differ about each, (k,) [m]."""
    upright = points[upright_of(points), :3]
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


def material_rows(path: Path, fewest: float = 0.005) -> list[str]:
    """A line a material of a simulated drive: its share of the upright points, and how many of them are scattered."""
    pattern = load_pattern(path / "pattern.yaml")
    rays = pattern.rays()
    fan = np.radians(np.array(pattern.azimuth_offset_deg))
    counts: dict[str, np.ndarray] = {}
    for frame in Drive(path):
        hits = load_hits(path / "hits" / f"{frame.name}.npz", rays)
        ring = frame.rays.ring.astype(int)
        column = np.angle(np.exp(1j * (frame.rays.azimuth - fan[ring])))
        step = np.round((np.pi - column) / (2 * np.pi) * pattern.firings - 0.5).astype(int) % pattern.firings
        upright = upright_of(frame.points)
        material = hits.solid.material[ring * pattern.firings + step][upright]
        scattered, _ = scatter_of(frame.points)
        for row, name in enumerate(hits.table.names):
            own = material == row
            counts[name] = counts.get(name, np.zeros(2)) + np.array([own.sum(), scattered[own].sum()])
    everything = sum(count for count, _ in counts.values())
    largest = sorted(counts.items(), key=lambda item: -item[1][0])
    return [
        f"  {name:22s} {count / everything:6.1%} of what is upright, {scattered / count:6.1%} of it scattered"
        for name, (count, scattered) in largest
        if count > fewest * everything
    ]


def main() -> None:
    """Print a line a drive, and one a material."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drives", nargs="*", type=Path)
    parser.add_argument("--real", type=Path, help="a folder in KITTI's layout")
    options = parser.parse_args()
    if options.real is not None:
        print(row(options.real))
    for path in options.drives:
        print("\n".join([row(path), *material_rows(path)]))


if __name__ == "__main__":
    main()
