"""Detection of swapped lasers: agreement of each ring's returns with each ring's traced ranges.

A swap is not a small change, so that Gauss–Newton cannot find it. This check needs no fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame

_AGREES_M, _AGREES_SHARE = 0.1, 0.005  # tolerance of agreement: [m], plus a share of the range
_FEWEST = 200  # minimum number of comparable beams of a ring
_MOST_FRAMES = 6
_OWN, _OTHER = (
    0.6,
    0.85,
)  # a ring is swapped if it agrees less with its own trace and more with another one


@dataclass(frozen=True)
class Exchange:
    """A ring whose returns agree with the trace of another ring.

    Attributes:
        ring: ring of the points.
        agrees_with: ring whose traced ranges they agree with.
        own, other: share of returns that agree with the trace of their own ring, and of the other one (0 to 1).
    """

    ring: int
    agrees_with: int
    own: float
    other: float


def agreement(frames: Sequence[TracedFrame]) -> np.ndarray:
    """Compute the share (rings, rings) of returns of each ring (row) that agree with each ring's trace (column)."""
    pattern = frames[0].shot.pattern
    agree, count = (np.zeros((pattern.rings, pattern.rings)) for _ in range(2))
    shape = pattern.rings, pattern.firings
    for frame in frames:
        traced = np.where(frame.shot.hits.solid.exists & ~frame.edge, frame.shot.hits.solid.range_m, np.nan)
        traced = traced.reshape(shape).astype(float)
        measured = np.where(frame.observed.trusted, frame.observed.range_from(frame.shot.rays.origin), np.nan)
        measured = measured.reshape(shape)
        for ring in range(pattern.rings):
            gap = np.abs(traced - measured[ring])
            known = np.isfinite(gap)
            agree[ring] += (known & (gap < _AGREES_M + _AGREES_SHARE * np.nan_to_num(traced))).sum(1)
            count[ring] += known.sum(1)
    return np.where(count >= _FEWEST, agree / np.maximum(count, 1), np.nan)


def exchanged_rings(frames: Sequence[TracedFrame]) -> tuple[Exchange, ...]:
    """Find pairs of rings whose returns agree with each other's trace much better than with their own.

    If all elevations are wrong, rings may agree with a neighbour's trace, but not in pairs.
    """
    chosen = frames[:: -(-len(frames) // _MOST_FRAMES)]
    share = agreement(chosen)
    known, share = np.isfinite(share.diagonal()), np.nan_to_num(share)
    best = np.argmax(share, axis=1)
    return tuple(
        Exchange(ring, int(other), float(share[ring, ring]), float(share[ring, other]))
        for ring, other in enumerate(best)
        if other != ring
        and best[other] == ring
        and known[ring]
        and share[ring, ring] < _OWN < _OTHER < share[ring, other]
    )


def exchange_notes(exchanged: Sequence[Exchange]) -> list[str]:
    """A sentence on each exchanged ring."""
    return [
        f"ring {one.ring} is probably exchanged with ring {one.agrees_with}: {one.other:.0%} of its returns agree with "
        f"the trace of that ring and {one.own:.0%} with its own; its beams were left out"
        for one in exchanged
    ]
