"""Laser of each point, recovered from the order of points in a scan without `rays/`.

Scans are ring-major, top ring first, and a ring is one turn of the head: KITTI's files rise in azimuth from 0,
ours fall from π. A new ring starts where that revolution starts again.
"""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti.rays import PointRays
from cosim.errors import FormatError

MAX_RINGS = 256  # ring numbers are uint8
_BREAK_RAD = 0.1  # azimuth falling back by more starts a ring; less is jitter
_SPREAD_M = 0.1  # standard deviation of the distances that a slope needs
_SEAM_RAD = 0.02  # a step of almost a full turn is jitter across the seam, taken back by the next step


def recover_rays(
    points: np.ndarray, sweep_s: float, elevations_rad: np.ndarray | None = None, source: str = "scan"
) -> PointRays:
    """The beams of a scan, from the order of its points.

    Args:
        points: (n, ≥ 3) in LiDAR axes, in the order of the file.
        sweep_s: duration of a turn; a beam fires at −azimuth/2π · sweep_s.
        elevations_rad: (k,) of the pattern's rings, if known: shows which rings have no return.
        source: the name that errors mention.

    Returns:
        Rays with `recovered` set, azimuth in (−π, π] and return number 0.

    Raises:
        FormatError: the points fall into more rings than there can be: they are in another order.
    """
    azimuth = np.arctan2(points[:, 1], points[:, 0], dtype=np.float64)
    runs = _runs(azimuth)
    count = int(runs.max(initial=-1)) + 1
    limit = MAX_RINGS if elevations_rad is None else len(elevations_rad)
    if count > limit:
        raise FormatError(
            f"{source}: the order of the points makes {count} rings, more than the {limit} there can be; "
            "a scan without rays/ must be stored ring by ring: give rays/ or sort it"
        )
    ring_of_run = np.arange(count)
    if elevations_rad is not None and count < limit:
        ring_of_run = _align(_run_elevations(points, runs, count), np.asarray(elevations_rad, np.float64))
    return PointRays(
        ring=ring_of_run[runs].astype(np.uint8),
        azimuth=azimuth.astype(np.float32),
        time_s=(-azimuth / (2 * np.pi) * sweep_s).astype(np.float32),
        return_no=np.zeros(len(azimuth), np.uint8),
        recovered=True,
    )


def _runs(azimuth: np.ndarray) -> np.ndarray:
    """Number of the turn each point belongs to, (n,) int64, not falling, from 0."""
    steps = (np.diff(azimuth) + np.pi) % (2 * np.pi) - np.pi
    small = steps[np.abs(steps) < _BREAK_RAD]
    rising = np.count_nonzero(small > 0) >= np.count_nonzero(small < 0)
    phase = (azimuth if rising else np.pi - azimuth) % (2 * np.pi)
    change = np.diff(phase, prepend=phase[:1], append=phase[-1:])
    up, down = change > 2 * np.pi - _SEAM_RAD, change < _SEAM_RAD - 2 * np.pi
    up[:1] = True  # the first point may be jitter below the seam
    phase = phase - 2 * np.pi * (up[:-1] & down[1:]) + 2 * np.pi * (down[:-1] & up[1:])
    return np.cumsum(np.diff(phase, prepend=phase[:1]) < -_BREAK_RAD)


def _run_elevations(points: np.ndarray, runs: np.ndarray, count: int) -> np.ndarray:
    """Elevation of each run [rad], (count,).

    A laser's points lie on a cone z = z0 + ρ·tan(elevation) about its optical centre, so the elevation is the
    slope of a line through them. Where all are at about one distance, the centre is taken to be the origin.
    """
    reach, height = np.hypot(points[:, 0], points[:, 1], dtype=np.float64), points[:, 2].astype(np.float64)
    number = np.bincount(runs, minlength=count)
    mean_reach = np.bincount(runs, reach, count) / number
    mean_height = np.bincount(runs, height, count) / number
    offset = reach - mean_reach[runs]
    spread = np.bincount(runs, offset**2, count)
    slope = np.bincount(runs, offset * height, count) / np.where(spread > 0, spread, 1)
    return np.where(spread > number * _SPREAD_M**2, np.arctan(slope), np.arctan2(mean_height, mean_reach))


def _align(measured: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Rings (increasing) for the runs such that the sum of elevation differences is least."""
    spare = len(expected) - len(measured)
    # cost[s]: best sum so far with s rings skipped; run i then takes ring i + s
    cost, choices = np.zeros(spare + 1), []
    for run, elevation in enumerate(measured):
        choice = np.zeros(spare + 1, int)
        for skipped in range(1, spare + 1):
            better = cost[choice[skipped - 1]] <= cost[skipped]
            choice[skipped] = choice[skipped - 1] if better else skipped
        cost = cost[choice] + np.abs(expected[run : run + spare + 1] - elevation)
        choices.append(choice)
    skipped = int(cost.argmin()) if len(measured) else 0
    rings = np.empty(len(measured), int)
    for run in range(len(measured) - 1, -1, -1):
        rings[run] = run + skipped
        skipped = int(choices[run][skipped])
    return rings
