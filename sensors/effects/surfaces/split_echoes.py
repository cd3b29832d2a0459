"""Footprints with parts farther apart than a pulse, where a few samples do not determine the reported echo."""

from __future__ import annotations

import numpy as np

from sensors.hits import Hits

CHANCE = 0.1  # that another part of the footprint answers than the one that its samples say


def sampled_ranges(middle: Hits, aside: Hits) -> np.ndarray:
    """Ranges (n, samples) float64 of the middle of every beam and of the samples around it, as many rows a beam."""
    first = middle.solid.range_m.astype(np.float64)[:, None]
    return np.hstack([first, aside.solid.range_m.astype(np.float64).reshape(len(first), -1)])


def is_split(ranges: np.ndarray, pulse_m: float) -> np.ndarray:
    """(n,) bool: whether following ranges (n, samples) lie farther apart than pulses of c·τ/2 merge."""
    ranges = np.sort(ranges, axis=1)
    gaps = np.diff(np.where(np.isfinite(ranges), ranges, 0.0), axis=1)
    return np.any((gaps > pulse_m) & np.isfinite(ranges[:, 1:]), axis=1)


def elsewhere(ranges: np.ndarray, split: np.ndarray, range_m: np.ndarray, pulse_m: float) -> np.ndarray:
    """Probability per metre (n,) of an answer at `range_m` (n,) from another part of footprints.

    Their samples lie at `ranges` (n, samples); only those that are `split` (n,) have other parts to answer. Parts
    between these return echoes, too: each sample represents a section as wide as the sample distance.
    """
    there = np.isfinite(ranges)
    known = np.where(there, ranges, 0.0)
    count = np.maximum(there.sum(1), 1)
    mean = known.sum(1) / count
    spread = np.sqrt((np.where(there, known - mean[:, None], 0.0) ** 2).sum(1) / count)
    width = np.maximum(spread, pulse_m / 2)[:, None]
    each = np.exp(-0.5 * ((range_m[:, None] - known) / width) ** 2) / (np.sqrt(2 * np.pi) * width)
    return CHANCE * split * (each * there).sum(1) / count
