"""Estimates of the same parameters from several drives or parts of one: combined, and compared with each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy import stats

from cosim.recordings.calibration.rounds import Round

_UPPER = 1.96
_LEVEL = 0.05

Estimates = Mapping[tuple[str, str], tuple[Any, Any]]
"""Value and 95 % interval by effect and parameter: numbers and pairs, or lists of them."""


@dataclass(frozen=True)
class Combined:
    """One number of a sensor, from several drives.

    Attributes:
        effect, parameter: which.
        row: place in a list with a number a laser; null for plain numbers.
        values, low, high: by drive; null where a drive does not estimate it.
        mean, mean_low, mean_high: all drives together with the 95 % interval, spread between drives included.
        p_agree: of Cochran's Q, that one value explains all drives; null of one drive.
    """

    effect: str
    parameter: str
    row: int | None
    values: tuple[float | None, ...]
    low: tuple[float | None, ...]
    high: tuple[float | None, ...]
    mean: float
    mean_low: float
    mean_high: float
    p_agree: float | None

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


@dataclass(frozen=True)
class Difference:
    """A number in two drives.

    Attributes:
        effect, parameter, row: which; `effect` is `pattern` for lasers' elevations and optical centres.
        drives: names of both.
        difference, low, high: second less first, with its 95 % interval.
        p_value: family-wise over everything compared (Holm, 1979).
    """

    effect: str
    parameter: str
    row: int | None
    drives: tuple[str, str]
    difference: float
    low: float
    high: float
    p_value: float

    @property
    def is_significant(self) -> bool:
        """Whether it differs at the 5 % level."""
        return self.p_value < _LEVEL

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {**asdict(self), "significant": self.is_significant}


def estimates_of(one: Round) -> dict[tuple[str, str], tuple[Any, Any]]:
    """Value and interval of everything that a round fitted and kept."""
    found: dict[tuple[str, str], tuple[Any, Any]] = {}
    again = [(name, values) for name, values in one.refitted.items() if name not in one.dropped]
    for name, values in [*((finding["effect"], finding) for finding in one.findings), *again]:
        for parameter, interval in values["ci95"].items():
            value = values["params"].get(parameter)
            if value is not None and interval is not None:
                found[name, parameter] = (value, interval)
    return found


def combine(drives: Sequence[Estimates]) -> tuple[Combined, ...]:
    """Every number that any drive estimates, over the drives that do.

    Weights of the random-effects model (DerSimonian and Laird, Controlled Clinical Trials 7, 1986).
    """
    keys = dict.fromkeys(key for one in drives for key in one)
    found = []
    for effect, parameter in keys:
        columns = [one.get((effect, parameter)) for one in drives]
        length = max((np.size(column[0]) for column in columns if column is not None and np.ndim(column[0])), default=0)
        for row in range(length) if length else [None]:
            found.append(_combined(effect, parameter, row, [_number(column, row) for column in columns]))
    return tuple(found)


def differences(names: Sequence[str], drives: Sequence[Estimates]) -> tuple[Difference, ...]:
    """Every number in every pair of drives that estimate it, the most significant first."""
    found: list[Difference] = []
    for one in combine(drives):
        for first, second in combinations(range(len(names)), 2):
            values = one.values[first], one.values[second]
            if values[0] is None or values[1] is None:
                continue
            low, high = (np.array([bound[first], bound[second]], float) for bound in (one.low, one.high))
            error = float(np.linalg.norm(high - low)) / 2 / _UPPER
            change = values[1] - values[0]
            p_value = float(2 * stats.norm.sf(abs(change) / error)) if error > 0 else float(change == 0)
            low, high = change - _UPPER * error, change + _UPPER * error
            pair = (names[first], names[second])
            found.append(Difference(one.effect, one.parameter, one.row, pair, change, low, high, p_value))
    return _family_wise(found)


def _family_wise(unadjusted: list[Difference]) -> tuple[Difference, ...]:
    ordered, least, adjusted = sorted(unadjusted, key=lambda one: one.p_value), 0.0, []
    for rank, one in enumerate(ordered):
        least = max(least, min(1.0, (len(ordered) - rank) * one.p_value))
        adjusted.append(Difference(**{**vars(one), "p_value": least}))
    return tuple(adjusted)


def _number(column: tuple[Any, Any] | None, row: int | None) -> tuple[float, float, float] | None:
    if column is None:
        return None
    value, interval = column if row is None else (column[0][row], column[1][row])
    if value is None or interval is None or not np.all(np.isfinite(interval)):
        return None
    return float(value), float(interval[0]), float(interval[1])


def _combined(
    effect: str, parameter: str, row: int | None, numbers: Sequence[tuple[float, float, float] | None]
) -> Combined:
    there = np.array([one for one in numbers if one is not None], float).reshape(-1, 3)
    values = there[:, 0]
    error = np.maximum((there[:, 2] - there[:, 1]) / 2 / _UPPER, 1e-12)
    weight, count, p_agree = 1 / error**2, len(values), None
    if count > 1:
        mean = weight @ values / weight.sum()
        excess = float(weight @ (values - mean) ** 2)
        p_agree = float(stats.chi2.sf(excess, count - 1))
        spread = max((excess - (count - 1)) / (weight.sum() - (weight**2).sum() / weight.sum()), 0.0)
        weight = 1 / (error**2 + spread)
    mean = float(weight @ values / weight.sum()) if count else float("nan")
    half = _UPPER / float(np.sqrt(weight.sum())) if count else float("nan")
    value, low, high = (tuple(None if one is None else one[n] for one in numbers) for n in range(3))
    return Combined(effect, parameter, row, value, low, high, mean, mean - half, mean + half, p_agree)
