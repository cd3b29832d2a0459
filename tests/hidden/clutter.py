"""Hidden physics of returns that no surface gives."""

from __future__ import annotations

import numpy as np

from tests.hidden.scan import Scan

_NO_MATERIAL, _NO_INSTANCE = -1, -2


def backscatter(scan: Scan, rng, density_per_m: float, mean_range_m: float) -> None:
    near, far = scan.beams.range_m
    # Nothing nearer than the nearest range is seen, or hides anything: the hazard counts from there.
    left = density_per_m * mean_range_m * np.exp(-near / mean_range_m)
    spent = rng.exponential(size=len(scan.found)) / left
    drop = np.full(len(spent), np.inf)
    drop[spent < 1] = near - mean_range_m * np.log1p(-spent[spent < 1])
    first = (drop < np.where(scan.found, scan.range_m, far)) & (drop <= far)
    reply(scan, first, drop[first], np.clip(0.02 + 0.004 * rng.normal(size=first.sum()), 0, 1))


def false_alarms(scan: Scan, rng, rate_per_frame: float, azimuth_deg: float, width_deg: float) -> None:
    turn = np.degrees(scan.beams.azimuth) - azimuth_deg
    sector = np.flatnonzero(np.abs((turn + 180) % 360 - 180) <= width_deg / 2)
    count = min(rng.poisson(rate_per_frame), len(sector))
    struck = rng.choice(sector, count, replace=False)
    reply(scan, struck, rng.uniform(*scan.beams.range_m, count), rng.uniform(0, 0.1, count))


def blooming(scan: Scan, rng, radius_deg: float, threshold: float) -> None:
    retro = (scan.material >= 0) & scan.table.retro[scan.material]
    sources = np.flatnonzero(scan.found & retro & (scan.intensity > threshold))
    if not len(sources):
        return
    direction = scan.beams.direction.astype(np.float32)
    nearest, owner = np.full(len(direction), np.cos(np.radians(radius_deg)), np.float32), np.full(len(direction), -1)
    others = scan.found.copy()
    others[sources] = False
    for source in sources:
        window = np.abs(direction - direction[source]).max(1) <= np.radians(radius_deg)
        rows = np.flatnonzero(window & others)
        close = direction[rows] @ direction[source]
        rows, close = rows[close >= nearest[rows]], close[close >= nearest[rows]]
        nearest[rows], owner[rows] = close, source
    rows = np.flatnonzero(owner >= 0)
    rows = rows[scan.range_m[rows] > scan.range_m[owner[rows]]]
    reply(scan, rows, scan.range_m[owner[rows]], 0.3 * scan.intensity[owner[rows]])


def reply(scan: Scan, rows, range_m, intensity) -> None:
    """Let beams return something that is no surface of the twin."""
    scan.found[rows], scan.range_m[rows], scan.intensity[rows] = True, range_m, intensity
    scan.material[rows], scan.instance[rows] = _NO_MATERIAL, _NO_INSTANCE
