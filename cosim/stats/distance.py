"""Distance of two samples, with an interval and a chance level from bootstrap samples of whole frames.

Objects and points of a frame are not independent of each other, so frames are what is drawn, never objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, vstack

_GRID = 1 / 500  # of the spread
_LOT = 25  # draws at a time: bounds memory


@dataclass(frozen=True, eq=False)
class FrameSample:
    """Values that belong to frames.

    Attributes:
        frame: (n,) int64 row of the frame.
        value: (n,) float64.
        weight: (n,) float64, how often the value was seen.
        frames: how many frames there are, those without any value included.
    """

    frame: np.ndarray
    value: np.ndarray
    weight: np.ndarray
    frames: int

    @classmethod
    def of(cls, frame: np.ndarray, value: np.ndarray, frames: int) -> FrameSample:
        """Values seen once each."""
        return cls(frame, np.asarray(value, np.float64), np.ones(len(frame)), frames)

    @classmethod
    def of_histograms(cls, counts: np.ndarray, values: np.ndarray) -> FrameSample:
        """Values (k,) seen `counts` (f, k) times in each of f frames."""
        frame, column = np.nonzero(counts)
        return cls(frame, np.asarray(values, np.float64)[column], counts[frame, column].astype(float), len(counts))

    def __len__(self) -> int:
        return len(self.value)

    @property
    def spread(self) -> float:
        """Standard deviation."""
        mean = np.average(self.value, weights=self.weight)
        return float(np.sqrt(np.average((self.value - mean) ** 2, weights=self.weight)))


class Pair:
    """Two samples on one axis: their cumulative distributions for any weighting of the frames.

    Args:
        a, b: neither without values.
        period: of values that are angles and the like; None for a line.
        grid: values are rounded to multiples of it; 0 leaves them.
    """

    def __init__(self, a: FrameSample, b: FrameSample, period: float | None = None, grid: float = 0.0) -> None:
        self._period = period
        values = np.concatenate([a.value, b.value])
        if grid > 0:
            values = np.round(values / grid) * grid
        if period is not None:
            values = values % period
        self._values, column = np.unique(values, return_inverse=True)
        self._a = _matrix(a, column[: len(a)], len(self._values))
        self._b = _matrix(b, column[len(a) :], len(self._values))

    def wasserstein(self, draws_a: np.ndarray, draws_b: np.ndarray) -> np.ndarray:
        """1-Wasserstein distances (d,), in the values' unit; NaN where a draw holds no value.

        ∫ |F_a − F_b| dx; on a circle the least over all shifts of the distributions' difference, which is its
        deviation from its median (Rabin, Delon, Gousseau, "Transportation distances on the circle", 2011).

        Args:
            draws_a, draws_b: (d, f) how often each frame is counted.
        """
        steps = np.diff(self._values, append=self._values[0] + self._period if self._period else self._values[-1])
        found = []
        for difference in self._differences(draws_a, draws_b):
            if self._period:
                difference = difference - _medians(difference, steps)[:, None]
            found.append(np.abs(difference) @ steps)
        return np.concatenate(found)

    def kolmogorov(self, draws_a: np.ndarray, draws_b: np.ndarray) -> np.ndarray:
        """Kolmogorov–Smirnov statistics (d,), max |F_a − F_b|; of two circles, Kuiper's, which knows no origin."""
        found = []
        for difference in self._differences(draws_a, draws_b):
            top, low = np.maximum(difference.max(1), 0), np.minimum(difference.min(1), 0)
            found.append(top - low if self._period else np.maximum(top, -low))
        return np.concatenate(found)

    def pooled(self) -> Pair:
        """The pair whose two sides are both all frames of both: draws then say which frame goes where."""
        pair = Pair.__new__(Pair)
        pair._period, pair._values = self._period, self._values
        pair._a = pair._b = csr_array(vstack([self._a, self._b]))
        return pair

    def _differences(self, draws_a: np.ndarray, draws_b: np.ndarray) -> list[np.ndarray]:
        lots = range(0, len(draws_a), _LOT)
        return [
            _cumulative(draws_a[at : at + _LOT] @ self._a) - _cumulative(draws_b[at : at + _LOT] @ self._b)
            for at in lots
        ]


@dataclass(frozen=True)
class DistanceEstimate:
    """A distance and what is known about it.

    Attributes:
        value: of the two sets as they are.
        low, high: 95 % interval, by the basic bootstrap over frames, not below 0.
        chance: median distance of two sets of these sizes whose frames are drawn from both together.
        floor: median distance of frames of b, as many as a has but at most half, from the rest of b.
    """

    value: float
    low: float
    high: float
    chance: float
    floor: float


def estimate(
    samples: Sequence[tuple[FrameSample, FrameSample]], period: float | None, draws: int, rng: np.random.Generator
) -> DistanceEstimate:
    """The mean 1-Wasserstein distance over pairs (directions of one cloud, or a single one), with its uncertainty.

    What is drawn is compared on a grid of a five-hundredth of the spread, which is faster and finer than the interval.

    Args:
        samples: of a and b, all of the same frames.
        period: see `Pair`.
        draws: of the bootstrap and of the permutation.
        rng: draws frames.
    """
    frames = samples[0][0].frames, samples[0][1].frames
    once = [np.ones((1, count)) for count in frames]
    value = float(np.mean([Pair(a, b, period).wasserstein(*once) for a, b in samples]))

    pairs = [Pair(a, b, period, max(a.spread, b.spread) * _GRID) for a, b in samples]
    drawn = [rng.multinomial(count, np.full(count, 1 / count), draws).astype(float) for count in frames]
    first = np.zeros((draws, sum(frames)))
    first[:, : frames[0]] = 1
    first = rng.permuted(first, axis=1)

    again = np.mean([pair.wasserstein(*drawn) for pair in pairs], axis=0)
    chance = np.mean([pair.pooled().wasserstein(first, 1 - first) for pair in pairs], axis=0)
    part = np.zeros((draws, frames[1]))
    part[:, : min(frames[0], frames[1] // 2)] = 1
    part = rng.permuted(part, axis=1)
    within = [Pair(b, b, period, b.spread * _GRID) for _, b in samples]
    floor = np.mean([pair.wasserstein(part, 1 - part) for pair in within], axis=0)
    # a distance of noisy samples is too large; mirroring the quantiles takes that back (Davison & Hinkley 1997, § 5.2)
    high, low = 2 * value - np.nanquantile(again, [0.025, 0.975])
    return DistanceEstimate(
        value, max(0.0, float(low)), max(0.0, float(high)), float(np.nanmedian(chance)), _median(floor)
    )


def _median(values: np.ndarray) -> float:
    """NaN without any, as of a set of one frame."""
    return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")


def _matrix(sample: FrameSample, column: np.ndarray, columns: int) -> csr_array:
    return csr_array(coo_array((sample.weight, (sample.frame, column)), shape=(sample.frames, columns)))


def _cumulative(counts: np.ndarray) -> np.ndarray:
    total = counts.sum(1, keepdims=True)
    return np.cumsum(counts, axis=1) / np.where(total > 0, total, np.nan)


def _medians(rows: np.ndarray, weights: np.ndarray) -> np.ndarray:
    order = np.argsort(rows, axis=1)
    mass = np.cumsum(weights[order], axis=1)
    middle = (mass >= mass[:, -1:] / 2).argmax(1)
    return np.take_along_axis(rows, np.take_along_axis(order, middle[:, None], 1), 1)[:, 0]
