"""Dependences that repeat along the firings of a revolution, with any period."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from cosim.discrepancy.groups.dependences import MEANS, scale
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.group import Group


def of_phases(fitter: Fitter, fitted: Fitted, rng: np.random.Generator) -> Iterator[Group]:
    """The strongest wave of each channel, if it stands out of all others: the largest line of the periodogram.

    Its null law is that of the largest line when scans have random signs.
    """
    sample, by = fitter.sample, fitter.settings.screen
    scans, firings = len(sample.names), int(sample.firing.max(initial=0)) + 1
    if firings < 4 * by.slowest or scans < 4:
        return
    signs = rng.choice((-1.0, 1.0), (by.wave_draws, scans))
    for channel in MEANS:
        if channel not in fitted.evidence.score:
            continue
        size = scale(fitted, channel)
        place = sample.frame * firings + sample.firing
        table = np.bincount(place, fitted.evidence.score[channel] * size, scans * firings).reshape(scans, firings)
        lines = np.fft.rfft(table, axis=1)[:, by.slowest :]
        own = (np.abs(lines) ** 2).sum(0)
        smooth = np.maximum(own, np.median(own))
        if not smooth.any():
            continue
        power = np.abs(lines.sum(0)) ** 2 / smooth
        drawn = (np.abs(signs @ lines) ** 2 / smooth).max(1)
        best = int(np.argmax(power))
        chance = (1 + np.count_nonzero(drawn >= power[best])) / (by.wave_draws + 1)
        if chance > fitter.settings.level / len(MEANS):
            continue
        waves = _refined(table.sum(0), best + by.slowest, by.wave_fine)
        turn = 2 * np.pi * waves / firings * sample.firing
        table = np.stack([np.cos(turn), np.sin(turn)], 1) * size[:, None]
        columns = sparse.csr_matrix(table)
        yield Group(
            f"{channel} by phase", channel, {channel: columns}, 2, ("phase",), label=f"{firings / waves:.6g}",
        )  # fmt: skip


def _refined(sums: np.ndarray, waves: int, values: int) -> float:
    """Waves a revolution where the periodogram of sums (firings,) is highest about a line."""
    fine = waves + np.linspace(-1, 1, values)
    turns = np.exp(-2j * np.pi * np.outer(fine, np.arange(len(sums))) / len(sums))
    return float(fine[np.argmax(np.abs(turns @ sums))])
