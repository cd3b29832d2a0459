"""What beams share errors with: the thing or spot they meet, their scan, and spots nearby."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import KDTree

_REACH_M = 30.0
_APART_M = 1e6  # so that worlds do not overlap


@dataclass(frozen=True, eq=False)
class Clusters:
    """Clusters of n beams.

    Attributes:
        track: (n,) int: an instance, or a cell of the map.
        scan: (n,) int.
        part: (n,) int part of a scan: where pose errors have been fitted and scans are few, these take their place.
        near: (tracks, tracks) how much of an error two tracks may share, 1 in the same spot, falling straight to 0
            where maps are told apart; 0 of a track with itself.
    """

    track: np.ndarray
    scan: np.ndarray
    part: np.ndarray
    near: sparse.csr_matrix


def nearness(cells: np.ndarray) -> sparse.csr_matrix:
    """How near map cells are, see `Clusters.near`.

    Args:
        cells: (tracks, 3) number of the world, x and y [m]; NaN of tracks that are no cells.
    """
    count, rows = len(cells), np.flatnonzero(np.isfinite(cells[:, 0]))
    if not len(rows):
        return sparse.csr_matrix((count, count))
    tree = KDTree(cells[rows] * [_APART_M, 1.0, 1.0])
    pairs = tree.query_pairs(_REACH_M, output_type="ndarray")
    one, other = rows[pairs[:, 0]], rows[pairs[:, 1]]
    share = 1 - np.linalg.norm(cells[one, 1:] - cells[other, 1:], axis=1) / _REACH_M
    both = np.append(one, other), np.append(other, one)
    return sparse.csr_matrix((np.append(share, share), both), (count, count))


def widened(sums: np.ndarray, information: np.ndarray, near: sparse.csr_matrix) -> float:
    """How much wider a sum over tracks scatters than if they were independent; at least 1.

    The scatter of spatially correlated errors is the sum of products over pairs, weighted by how near they are
    (Conley, J. Econometrics 1999), here of what a constant amplitude leaves unexplained in every track.

    Args:
        sums: (tracks, columns) scores.
        information: (tracks,) of an amplitude that is the same everywhere.
        near: (tracks, tracks), see `Clusters.near`.
    """
    total = float(information.sum())
    if not near.nnz or total <= 0:
        return 1.0
    apart = sums - np.outer(information / total, sums.sum(0))
    square = float((apart**2).sum())
    if square <= 0:
        return 1.0
    shared = float((apart * (near @ apart)).sum())
    return float(np.sqrt(max(1 + shared / square, 1.0)))


def compressed(gain: np.ndarray) -> np.ndarray:
    """Sizes of gains (n,) as logarithms, with their signs."""
    return np.sign(gain) * np.log1p(np.abs(gain))
