"""A long recording in overlapping segments, each a world of its own, and how these worlds lie to each other.

What mapping holds at a time grows with the scans of a map, and their joint adjustment with the cube of them. A short
recording is one segment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

SCANS = 150  # that a segment has to itself, about; a recording of twice as many is one segment
_OVERLAP, _LEAST_OVERLAP = 0.1, 5  # share of a segment that it has of each neighbour, and scans
_ARM_M = 10.0  # of the axes by which poses are held against each other


@dataclass(frozen=True)
class Segment:
    """Scans that make one map.

    Attributes:
        number: from 0.
        first, last: its scans; the last is excluded.
        begin, end: scans that belong to no other segment; the end is excluded.
    """

    number: int
    first: int
    last: int
    begin: int
    end: int

    def __len__(self) -> int:
        return self.last - self.first

    @property
    def own(self) -> slice:
        """Scans that belong to no other segment."""
        return slice(self.begin - self.first, self.end - self.first)


def segments_of(count: int, scans: int | None = None) -> tuple[Segment, ...]:
    """The segments of a recording.

    Args:
        count: of its scans.
        scans: that a segment has to itself, about; 150 by default.
    """
    scans = scans or SCANS
    if count <= 2 * scans:
        return (Segment(0, 0, count, 0, count),)
    more = max(round(_OVERLAP * scans), _LEAST_OVERLAP)
    edges = np.linspace(0, count, round(count / scans) + 1).round().astype(int).tolist()
    return tuple(
        Segment(number, max(begin - more, 0), min(end + more, count), begin, end)
        for number, (begin, end) in enumerate(pairwise(edges))
    )


def chained(segments: Sequence[Segment], poses: Sequence[np.ndarray]) -> np.ndarray:
    """The world of each segment in that of the first (k, 4, 4), from scans that neighbours share.

    Args:
        segments: in order.
        poses: of all scans of each, (n, 4, 4) in its own world.
    """
    found = [np.eye(4)]
    for before, segment, theirs, own in zip(segments[:-1], segments[1:], poses[:-1], poses[1:], strict=True):
        shared = slice(segment.first, before.last)
        there = theirs[shared.start - before.first : shared.stop - before.first]
        here = own[: shared.stop - shared.start]
        found.append(found[-1] @ _carrying(_arms(here), _arms(there)))
    return np.array(found)


def together(segments: Sequence[Segment], poses: Sequence[np.ndarray]) -> np.ndarray:
    """The poses (n, 4, 4) of all scans in the world of the first segment; arguments as of `chained`."""
    worlds = chained(segments, poses)
    return np.concatenate(
        [world @ own[segment.own] for segment, world, own in zip(segments, worlds, poses, strict=True)]
    )


def _arms(poses: np.ndarray) -> np.ndarray:
    """Places and tips of the axes of poses (n, 4, 4): (4 n, 3)."""
    tips = poses[:, :3, 3][:, None] + _ARM_M * np.swapaxes(poses[:, :3, :3], 1, 2)
    return np.concatenate([poses[:, :3, 3], tips.reshape(-1, 3)])


def _carrying(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """The rigid motion (4, 4) that carries places (n, 3) best to others (Kabsch, Acta Crystallographica A 32, 1976)."""
    left, right = here - here.mean(0), there - there.mean(0)
    u, _, v = np.linalg.svd(left.T @ right)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))])
    found = np.eye(4)
    found[:3, :3] = (u @ flip @ v).T
    found[:3, 3] = there.mean(0) - found[:3, :3] @ here.mean(0)
    return found
