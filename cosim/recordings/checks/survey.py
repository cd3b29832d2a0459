"""One pass over all scans of a recording: a few numbers of each, that checks compare."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosim.recordings.pattern.lasers import nearest_laser
from cosim.recordings.recording import Recording

_NEAREST_M = 5.0  # from the axis; nearer points blur elevations
_BIN_DEG = 0.1
_ON_BEAM_DEG = 0.06
_MOST_POINTS = 40_000  # of a scan, that elevations are counted of


@dataclass(frozen=True, eq=False)
class Survey:
    """Numbers of n scans and k lasers.

    Attributes:
        digest: (n,) hash of the points of each scan.
        points: (n,) points.
        has_intensity: (n,) bool.
        elevations: (n, b) share of points by elevation, in bins of 0.1°.
        by_laser: (n, k) share of points on each laser.
    """

    digest: tuple[bytes, ...]
    points: np.ndarray
    has_intensity: np.ndarray
    elevations: np.ndarray
    by_laser: np.ndarray


def survey_scans(recording: Recording, lines: np.ndarray, on_scan: Callable[[], object] = lambda: None) -> Survey:
    """Read all scans once.

    Args:
        recording: scans in order.
        lines: (k, 2) cones of the lasers, see `Lasers.lines`.
        on_scan: called after each.

    Raises:
        RecordingError: a scan is damaged.
    """
    digests, points, lit, elevations, by_laser = [], [], [], [], []
    bins = round(180 / _BIN_DEG)
    for scan in recording:
        digests.append(hashlib.blake2b(np.ascontiguousarray(scan.xyz).tobytes(), digest_size=16).digest())
        points.append(len(scan))
        lit.append(scan.intensity is not None)
        step = max(1, -(-len(scan) // _MOST_POINTS))
        rho, z = scan.flat_range_m[::step], scan.xyz[::step, 2]
        far = rho > _NEAREST_M
        bin_of = ((np.degrees(np.arctan2(z[far], rho[far])) + 90) / _BIN_DEG).astype(int)
        elevations.append(_shares(np.bincount(np.clip(bin_of, 0, bins - 1), minlength=bins)))
        which, off = nearest_laser(rho, z, lines)
        on = np.abs(off) < np.radians(_ON_BEAM_DEG)
        by_laser.append(_shares(np.bincount(which[on], minlength=len(lines))))
        on_scan()
    return Survey(tuple(digests), np.array(points), np.array(lit), np.array(elevations, np.float32), np.array(by_laser))


def _shares(counts: np.ndarray) -> np.ndarray:
    return counts / max(counts.sum(), 1)
