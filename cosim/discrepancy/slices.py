"""Where a model is worst: residuals by ring, range, material and kind."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.scores import SCALES, FrameScores

_RANGES_M = (0, 10, 20, 30, 45, 60, 80, 1000)
_RING_BAND, _BANDS = 16, 4
_FEWEST = 300
_SHOWN = 12


@dataclass(frozen=True)
class Slice:
    """Beams with something in common.

    Attributes:
        where: in words.
        channel: range, intensity or drop.
        beams: how many.
        bias, spread: mean and standard deviation of the residual, measured − model, in the channel's unit.
        share: of the channel's part of the error that arises here.
    """

    where: str
    channel: str
    beams: int
    bias: float
    spread: float
    share: float

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    def __str__(self) -> str:
        if self.channel == "range":
            return f"{self.where}: {self.bias * 100:+.1f} cm"
        if self.channel == "drop":
            return f"{self.where}: {self.bias:+.0%} returns"
        return f"{self.where}: intensity {self.bias:+.3f}"


class SliceTally:
    """Sums residuals by slice, frame after frame."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()
        self._rings = 0
        self._sums: dict[str, dict[tuple[int, int, int], np.ndarray]] = {
            channel: defaultdict(lambda: np.zeros(4)) for channel in ("range", "intensity", "drop")
        }

    def add(self, frame: TracedFrame, scores: FrameScores) -> None:
        """Add a frame."""
        solid, ring = frame.shot.hits.solid, frame.shot.rays.ring
        self._names, self._rings = frame.shot.hits.table.names, frame.shot.pattern.rings
        band = np.minimum(ring // _RING_BAND, _BANDS - 1)
        reach = np.searchsorted(_RANGES_M, np.nan_to_num(solid.range_m, posinf=999.0), side="right") - 1
        key = (solid.material.astype(int) * _BANDS + band) * 8 + reach
        residual = scores.measured_m - scores.range_m
        bright = scores.measured_intensity - scores.intensity
        outcome = (~np.isnan(scores.measured_m)).astype(float) - scores.expected
        lit = scores.matched & np.isfinite(scores.intensity_score)
        clear = ~scores.ambiguous & solid.exists
        for channel, rows, values, score in (
            ("range", scores.matched, residual, scores.range_score),
            ("intensity", lit, bright, scores.intensity_score),
            ("drop", clear, outcome, scores.brier),
        ):
            used = np.flatnonzero(rows)
            keys, place = np.unique(key[used], return_inverse=True)
            mine, cost = values[used].astype(np.float64), score[used].astype(np.float64)
            columns = (np.bincount(place, w) for w in (np.ones(len(used)), mine, mine**2, np.nan_to_num(cost)))
            for row, code in zip(np.stack(list(columns), 1), keys.tolist(), strict=True):
                self._sums[channel][(code // 8 // _BANDS, code // 8 % _BANDS, code % 8)] += row

    def worst(self) -> tuple[Slice, ...]:
        """Slices whose bias stands out, by how much of the error is theirs."""
        found = []
        for channel, sums in self._sums.items():
            total = sum(row[3] for row in sums.values()) or 1.0
            weight = sum(row[0] for row in sums.values()) or 1.0
            for key, (count, one, two, cost) in sums.items():
                if count >= _FEWEST:
                    bias = one / count
                    spread = float(np.sqrt(max(two / count - bias**2, 0)))
                    share = cost / total
                    pull = abs(bias) / SCALES[channel] * count / weight
                    found.append((pull, Slice(self._words(key), channel, int(count), bias, spread, share)))
        found.sort(key=lambda row: -row[0])
        return tuple(one for _, one in found[:_SHOWN])

    def _words(self, key: tuple[int, int, int]) -> str:
        material, band, reach = key
        name = self._names[material].replace("_", " ")
        low, high = _RANGES_M[reach], _RANGES_M[reach + 1]
        far = f"beyond {low} m" if high == _RANGES_M[-1] else f"at {low}–{high} m"
        if self._rings <= _RING_BAND:
            return f"{name} {far}"
        last = self._rings - 1 if band == _BANDS - 1 else min(band * _RING_BAND + _RING_BAND, self._rings) - 1
        return f"rings {band * _RING_BAND}–{last} on {name} {far}"
