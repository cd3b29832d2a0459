"""How weak an effect may be that a gate would still find, with 80 % power."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

import numpy as np

from cosim.discrepancy.inference.clusters import compressed
from cosim.discrepancy.inference.wild_bootstrap import deviates

if TYPE_CHECKING:
    from cosim.discrepancy.gate import Sums

Z80 = 0.8416  # deviates beyond what the gate takes, for 80 % power
_TIMES = np.geomspace(0.01, 100, 93)
_MEAN_SIZE, _SIZE_SPREAD = np.sqrt(2 / np.pi), np.sqrt(1 - 2 / np.pi)  # of a standard normal deviate's size


def smallest_amplitude(one: Sums, needed: float) -> float:
    """Amplitude at which the statistic would be expected at so many deviates."""
    if one.direction.gain is not None:
        return _countable(one, needed)
    if _reach(one) < needed:
        return float("nan")
    scatter = max(one.spread * np.linalg.norm(one.track), one.drift * np.linalg.norm(one.scan))
    error = scatter / max(one.information, 1e-300)
    return max(float(needed * error), one.direction.column.resolved(one.quantity))


def _reach(one: Sums) -> float:
    """How high the statistic is at most, which is when all tracks and scans agree: few do so by chance, too."""
    columns, found = one.scan.shape[1], []
    for share in (one.track_information, one.scan_information):
        agreed = float(share.sum() / max(np.linalg.norm(share), 1e-300))
        if columns > 1:
            found.append((agreed - 1) * float(np.sqrt(2 * columns)))
            continue
        size = float(deviates(np.array([agreed]), share)[0])
        found.append(size if one.direction.one_sided else float((size - _MEAN_SIZE) / _SIZE_SPREAD))
    return min(found)


def _countable(one: Sums, needed: float) -> float:
    """The same of strays, Poisson counts by cluster beside what there is already; NaN where none are added."""
    strays = one.direction.strays
    if strays is None:
        return float("nan")
    clusterings = tuple(zip((one.track, one.scan), one.expected, (one.spread, one.drift), strict=True))
    worth = strays.each * strays.gain

    def reached(times: float) -> float:
        found = []
        for sums, expected, wider in clusterings:
            count = times * expected / strays.each
            mean, there = worth * count - expected, sums[:, 0] + expected
            typical = compressed(np.sqrt(mean**2 + worth**2 * count + there**2))
            z = float(compressed(mean).sum() / (wider * np.linalg.norm(typical)))
            found.append(float(deviates(np.array([z]), typical)[0]))
        return min(found)

    row = bisect_left(_TIMES, needed, key=reached)
    return float(_TIMES[row] * strays.step) if row < len(_TIMES) else float("nan")
