"""Rotation of the head: azimuth steps, azimuth offsets of the lasers, and the order of the points.

Firings on a fixed grid of azimuths show as a line in the spectrum of azimuths (the sum of e^{iNφ} over points is
greatest where N firings make a turn). A head whose speed wavers has no such grid: its step is the usual distance
between neighbouring points of a laser.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from cosim.recordings.pattern.lasers import rounding_m
from cosim.recordings.scan import Scan

Known = Literal["times", "firing order", "ring starts", "within a step", "not at all"]
Order = Literal["ring by ring", "firing by firing", "unordered"]

_BINS = 1 << 17  # of azimuth, for the spectrum
_FEWEST, _MOST = 180, 8192  # firings a turn
_CLEAR = 0.5  # of the amplitude that a perfect grid would have
_MOST_BLUR_RAD = 0.5  # standard deviation of a firing's phase, of 2π; lowers a line of the spectrum by 12 %
_PASSES = 3  # the first estimate of the step decides which points are sharp
_EQUAL = 0.95  # of the clearest line's amplitude
_STEPS = (0.25, 1.4)  # distances between neighbours that are one step
_RUN_SHARE = 0.9
_FEWEST_OF_RING = 100  # points in a row that are a ring, or a part of it
_WIDEST = np.pi / 4  # that a laser may be offset to either side


@dataclass(frozen=True, eq=False)
class Turning:
    """Estimates of the head's rotation from the points.

    Attributes:
        firings: azimuth steps a turn.
        firings_sd: its standard error; 0 on a fixed grid.
        fixed: whether azimuths lie on one grid in every scan.
        order: of the points in the files.
        clockwise: whether azimuths decrease with time; None if the order does not show it.
        fan_deg: (k,) sideways offset of each laser, counter-clockwise.
        fan_known: how well: from times, the order of firings, the beginnings of rings, or the grid (to a step).
    """

    firings: int
    firings_sd: float
    fixed: bool
    order: Order
    clockwise: bool | None
    fan_deg: np.ndarray
    fan_known: Known


def find_turning(scans: Sequence[Scan], which: Sequence[np.ndarray], lasers: int, sweep_s: float) -> Turning:
    """Estimate the rotation of the head.

    Args:
        scans: of the recording.
        which: row of the laser of each of their points, −1 for none; top first.
        lasers: how many there are.
        sweep_s: duration of a turn.
    """
    sharp = which
    for _ in range(_PASSES):
        rate, rate_sd = _by_distance(scans, sharp, lasers)
        sharp = [np.where(_is_sharp(scan, rate), row, -1) for scan, row in zip(scans, which, strict=True)]
    grid, phase = _spectrum(scans, sharp, lasers, rate)
    order, clockwise = _order(scans, which)
    firings = grid or round(rate)
    fan, known = _fan(scans, which, lasers, order, clockwise, sweep_s, firings)
    if grid:
        fan, known = _on_grid(fan, known, phase, grid)
    return Turning(firings, 0.0 if grid else rate_sd, bool(grid), order, clockwise, np.round(fan, 4), known)


def _is_sharp(scan: Scan, rate: float) -> np.ndarray:
    """(n,) bool points whose azimuths the rounding of coordinates blurs by much less than a step of 2π/rate."""
    blur_rad = rounding_m(scan.xyz) / np.sqrt(12) / np.maximum(scan.flat_range_m, 1e-9)
    return blur_rad * rate < _MOST_BLUR_RAD


def _by_distance(scans: Sequence[Scan], which: Sequence[np.ndarray], lasers: int) -> tuple[float, float]:
    """Steps a turn and their standard error, from distances between neighbouring points of a laser."""
    found = []
    for scan, row in zip(scans, which, strict=True):
        azimuth, row = scan.azimuth_rad[row >= 0], row[row >= 0]
        order = np.lexsort((azimuth, row))
        gap = np.diff(azimuth[order])[np.diff(row[order]) == 0]
        gap = gap[gap > 1e-5]
        if len(gap) < lasers:
            continue
        usual = float(np.median(gap[gap < 3 * np.median(gap)]))
        for _ in range(3):
            usual = float(np.mean(gap[(gap > _STEPS[0] * usual) & (gap < _STEPS[1] * usual)]))
        found.append(2 * np.pi / usual)
    if not found:
        return 0.0, 0.0
    error = float(np.std(found, ddof=1)) / np.sqrt(len(found)) if len(found) > 1 else 0.01 * found[0]
    return float(np.median(found)), error


def _spectrum(scans: Sequence[Scan], which: Sequence[np.ndarray], lasers: int, rate: float) -> tuple[int, np.ndarray]:
    """Firings a turn of a fixed grid, 0 without one, and each laser's phase on it [rad], (k,)."""
    azimuth = np.concatenate([scan.azimuth_rad for scan in scans])
    row = np.concatenate(which)
    cell = ((azimuth + np.pi) / (2 * np.pi) * _BINS).astype(np.int64) % _BINS
    total = np.zeros(_MOST + 1)
    lines = np.zeros((lasers, _MOST + 1), complex)
    for laser in range(lasers):
        own = cell[row == laser]
        if len(own):
            turned = np.fft.rfft(np.bincount(own, minlength=_BINS))[: _MOST + 1].conj() / len(own)
            lines[laser] = turned
            total += len(own) * np.abs(turned)
    total /= max(len(cell[row >= 0]), 1)
    low, high = max(_FEWEST, round(0.8 * rate)), min(_MOST, round(1.25 * rate) + 1)
    if high <= low or total[low:high].max() < _CLEAR:
        return 0, np.zeros(lasers)
    # With an encoder of T ticks, N and T − N firings look the same: of equally clear lines choose the most usual step.
    clear = low + np.flatnonzero(total[low:high] > _EQUAL * total[low:high].max())
    lines_apart = np.split(clear, np.flatnonzero(np.diff(clear) > 1) + 1)
    tops = [int(line[total[line].argmax()]) for line in lines_apart]
    best = min(tops, key=lambda top: abs(top - rate))
    # azimuth bins start at −π; a phase of 0 is a firing at azimuth π
    return best, np.angle(lines[:, best] * np.exp(1j * np.pi * best / _BINS))


def _order(scans: Sequence[Scan], which: Sequence[np.ndarray]) -> tuple[Order, bool | None]:
    """Order of the points, and whether the azimuths of a laser decrease along the file."""
    same, near, falling = [], [], []
    for scan, row in zip(scans, which, strict=True):
        good = row >= 0
        azimuth, row = scan.azimuth_rad[good], row[good]
        if len(row) < 100:
            continue
        same.append(np.mean(np.diff(row) == 0))
        near.append(np.mean(np.abs(_wrapped(np.diff(azimuth))) < np.radians(30)))
        order = np.argsort(row, kind="stable")
        step = _wrapped(np.diff(azimuth[order]))[np.diff(row[order]) == 0]
        falling.append(np.mean(step < 0))
    if not same or np.mean(near) < _RUN_SHARE:
        return "unordered", None
    share = float(np.mean(falling))
    return (
        "ring by ring" if np.mean(same) > _RUN_SHARE else "firing by firing",
        None if 0.2 < share < 0.8 else share > 0.5,
    )


def _fan(
    scans: Sequence[Scan],
    which: Sequence[np.ndarray],
    lasers: int,
    order: Order,
    clockwise: bool | None,
    sweep_s: float,
    firings: int,
) -> tuple[np.ndarray, Known]:
    sense = -1.0 if clockwise in (True, None) else 1.0
    timed = all(scan.time_s is not None for scan in scans)
    if timed:
        samples = [
            _relative(scan.azimuth_rad - sense * 2 * np.pi * np.asarray(scan.time_s) / sweep_s, row, lasers)
            for scan, row in zip(scans, which, strict=True)
        ]
        return _converged(samples), "times"
    if order == "firing by firing":
        return _side_by_side(scans, which, lasers), "firing order"
    if order == "ring by ring" and clockwise is not None:
        fan = _of_ring_ends(scans, which, lasers, sense, 2 * np.pi / max(firings, 1))
        if float(np.ptp(np.quantile(fan, (0.1, 0.9)))) > 2 * 2 * np.pi / max(firings, 1):
            return np.degrees(fan), "ring starts"
    return np.zeros(lasers), "not at all"


def _relative(azimuth: np.ndarray, row: np.ndarray, lasers: int) -> np.ndarray:
    """Circular mean of each laser's values against that of all [deg], (k,); NaN without points."""
    everyone = np.angle(np.exp(1j * azimuth[row >= 0]).mean()) if (row >= 0).any() else 0.0
    good = row >= 0
    turned, own = azimuth[good] - everyone, row[good]
    count = np.bincount(own, minlength=lasers)
    total = np.arctan2(np.bincount(own, np.sin(turned), lasers), np.bincount(own, np.cos(turned), lasers))
    return np.where(count > 20, np.degrees(total), np.nan)


def _side_by_side(scans: Sequence[Scan], which: Sequence[np.ndarray], lasers: int) -> np.ndarray:
    """Offsets [deg] (k,) from points that follow each other in the file: most of them are of one firing.

    The median difference of azimuth of every pair of lasers that follow each other often; offsets are sums of these
    along the spanning tree of the commonest pairs.
    """
    first, second, apart = [], [], []
    for scan, row in zip(scans, which, strict=True):
        good = row >= 0
        azimuth, row = scan.azimuth_rad[good], row[good]
        first.append(row[:-1])
        second.append(row[1:])
        apart.append(_wrapped(np.diff(azimuth)))
    pair = np.concatenate(first) * lasers + np.concatenate(second)
    step = np.concatenate(apart)
    order = np.lexsort((step, pair))
    pair, step = pair[order], step[order]
    pairs, start, count = np.unique(pair, return_index=True, return_counts=True)
    middle = step[start + count // 2]
    often = count > 10
    a, b = np.divmod(pairs[often].astype(np.int32), lasers)
    tree = minimum_spanning_tree(coo_array((1.0 / count[often], (a, b)), shape=(lasers, lasers)))
    known = dict(zip(zip(a.tolist(), b.tolist(), strict=True), middle[often].tolist(), strict=True))
    fan = np.zeros(lasers)
    root = int(np.bincount(a, count[often], lasers).argmax()) if len(a) else 0
    visited, before = breadth_first_order(tree, root, directed=False)
    for laser in visited[1:].tolist():
        parent = int(before[laser])
        forward, backward = known.get((parent, laser)), known.get((laser, parent))
        fan[laser] = fan[parent] + (forward if forward is not None else -(backward or 0.0))
    return np.degrees(fan - np.median(fan[visited]))


def _wrapped(angle_rad: np.ndarray) -> np.ndarray:
    return (angle_rad + np.pi) % (2 * np.pi) - np.pi


def _of_ring_ends(
    scans: Sequence[Scan], which: Sequence[np.ndarray], lasers: int, sense: float, step: float
) -> np.ndarray:
    """(k,) azimuth offsets [rad] from the start and end of each ring, as all rings make one revolution from one seam.

    A ring starts late and ends early where nothing returns, as in the sky: its first and last points bound its offset
    from both sides. Within these bounds the offset of rings with a known one is used. The seam is in front or
    behind, wherever most rings start.
    """
    first, last = np.full((len(scans), lasers), np.nan), np.full((len(scans), lasers), np.nan)
    for number, (scan, row) in enumerate(zip(scans, which, strict=True)):
        begin = np.flatnonzero(np.diff(row, prepend=-2) != 0)
        end = np.append(begin[1:], len(row)) - 1
        long = (end - begin > _FEWEST_OF_RING) & (row[begin] >= 0)
        first[number, row[begin[long][::-1]]] = sense * scan.azimuth_rad[begin[long][::-1]]  # of several, the first
        last[number, row[end[long]]] = sense * scan.azimuth_rad[end[long]]
    seam = np.pi if np.median(np.cos(first[np.isfinite(first)])) < 0 else 0.0
    most = np.fmin.reduce((first - seam + _WIDEST) % (2 * np.pi) - _WIDEST) - step / 2
    least = np.fmax.reduce((last - seam - _WIDEST) % (2 * np.pi) + _WIDEST) - 2 * np.pi + step / 2
    is_determined = most - least < 2 * step
    usual = float(np.median((most + least)[is_determined])) / 2 if is_determined.any() else 0.0
    return sense * np.where(np.isfinite(most), np.clip(usual, least, np.maximum(least, most)), usual)


def _converged(samples: list[np.ndarray]) -> np.ndarray:
    """The median over scans, the middle of all lasers at 0, 0 for lasers that are never seen."""
    table = np.array(samples)
    seen = np.isfinite(table).any(0)
    fan = np.full(table.shape[1], np.nan)
    fan[seen] = np.nanmedian(table[:, seen], axis=0)
    return np.nan_to_num(fan - _middle(fan))


def _middle(fan: np.ndarray) -> float:
    good = fan[np.isfinite(fan)]
    return float(np.median(good)) if len(good) else 0.0


def _on_grid(
    fan: np.ndarray,
    known: Known,
    phase: np.ndarray,
    firings: int,
) -> tuple[np.ndarray, Known]:
    """The fan with its part of a step from the phase on the grid, step k firing at azimuth π − 2π(k + 0.5)/firings."""
    step = 360.0 / firings
    part = (np.degrees(phase) / firings + step / 2) % step  # offset within a step
    part = np.where(part > step / 2, part - step, part)
    if known == "not at all":
        return part, "within a step"
    rest = np.angle(np.exp(2j * np.pi * (fan - part) / step).mean()) / (2 * np.pi) * step  # a common shift of all
    return part + step * np.round((fan - rest - part) / step), known
