"""The sector of azimuths in which returns from nowhere crowd (Kulldorff's scan statistic, Commun. Stat. 1997)."""

from __future__ import annotations

import numpy as np

from cosim.discrepancy.inference.likelihood import Fit
from cosim.discrepancy.sampling.sample import Sample
from cosim.discrepancy.settings import DEFAULT, Search

AZIMUTH, WIDTH = "azimuth_deg", "width_deg"


def crowded_sector(sample: Sample, fit: Fit, by: Search = DEFAULT.search) -> dict[str, float]:
    """Middle and width [°] of the sector whose share of strays stands out most from its share of beams."""
    turn = np.degrees(sample.azimuth) % 360
    stray = sample.returned & sample.clear & (fit.matched < 0.5)
    if not stray.any():
        return {AZIMUTH: 0.0, WIDTH: 360.0}
    strays, beams = _Share(turn[stray], sample.weight[stray]), _Share(turn, sample.weight)
    grid = np.arange(by.edges) * 360 / by.edges
    start, end = _best(strays, beams, grid, grid, by)
    for _ in range(2):
        aside = np.linspace(-1.5, 1.5, by.fine + 1) * 360 / by.edges
        start, _ = _best(strays, beams, start + aside, np.array([end]), by)
        _, end = _best(strays, beams, np.array([start]), end + aside, by)
    width = (end - start) % 360
    middle = (start + width / 2 + 180) % 360 - 180
    return {AZIMUTH: float(middle), WIDTH: float(width)}


class _Share:
    """Share of a weight up to an azimuth."""

    def __init__(self, turn: np.ndarray, weight: np.ndarray) -> None:
        order = np.argsort(turn)
        self._turn, self._sum = turn[order], np.append(0.0, np.cumsum(weight[order]))
        self.total = float(self._sum[-1])

    def between(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Of azimuths from start (s, 1) on to end (e,), going round."""
        low, high = (self._sum[np.searchsorted(self._turn, edge % 360)] for edge in (start, end))
        return ((high - low) + self.total * ((end % 360) <= (start % 360))) / self.total


def _best(strays: _Share, beams: _Share, starts: np.ndarray, ends: np.ndarray, by: Search) -> tuple[float, float]:
    inside, size = (share.between(starts[:, None], ends) for share in (strays, beams))
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.nan_to_num(inside * np.log(inside / size))
        gain += np.nan_to_num((1 - inside) * np.log((1 - inside) / (1 - size)))
    gain[(inside < size) | (size < by.least_sector) | (size > by.most_sector)] = -np.inf
    row, column = np.unravel_index(int(np.argmax(gain)), gain.shape)
    return float(starts[row]), float(ends[column])
