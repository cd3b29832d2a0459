"""The error: how badly the model predicts single vehicles, in every channel.

Each vehicle is compared with the same vehicle in simulations of the same demand with other seeds, by the continuous
ranked probability score with the correction for small ensembles (Gneiting and Raftery, JASA 2007; Ferro, QJRMS 2014).
The score is proper: in expectation no model has a smaller error than the true one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from cosim.driver_discrepancy.channels import BASES, CHANNELS
from cosim.driver_discrepancy.summary import Summary

_FEWEST_VEHICLES, _FEWEST_SHARE = 10, 1 / 3
_FEWEST_SEEDS = 3  # one is the measurement, and two have a spread
_LARGEST = 10.0  # scales, to which a single difference is limited
_NEGLIGIBLE = 0.02  # scales, below which a change of an error does not matter


@dataclass(frozen=True, eq=False)
class Scores:
    """Errors of vehicles.

    Attributes:
        ids: of v vehicles.
        channels: names of c channels.
        table: (v, c) score over the channel's scale; NaN where a vehicle does not show it.
        by_seed: (s, v, c) the same with a seed left out.
    """

    ids: tuple[str, ...]
    channels: tuple[str, ...]
    table: np.ndarray
    by_seed: np.ndarray

    def of(self, ids: frozenset[str]) -> Scores:
        """Those of some vehicles."""
        keep = np.array([name in ids for name in self.ids], bool)
        names = tuple(name for name in self.ids if name in ids)
        return Scores(names, self.channels, self.table[keep], self.by_seed[:, keep])

    def by_channel(self) -> dict[str, float]:
        """Mean score of each channel over its scale; NaN where too few vehicles show it.

        Ten vehicles are enough, and so is a third of fewer than thirty.
        """
        return dict(zip(self.channels, _means(self.table).tolist(), strict=True))

    def by_group(self) -> dict[str, float]:
        """Mean of the channels of each group."""
        return _grouped(self.by_channel())

    @property
    def error(self) -> float:
        """Mean over the groups of channels."""
        return _total(self.by_channel())


@dataclass(frozen=True)
class Fall:
    """Decrease of an error from one model to another, on the same vehicles and seeds.

    Attributes:
        before, after: errors.
        interval: 95 % interval of the fall over seeds and vehicles.
        worse: groups of channels whose error rises by more than two standard errors, with the rise over their scale.
    """

    before: float
    after: float
    interval: tuple[float, float]
    worse: Mapping[str, float]

    @property
    def size(self) -> float:
        """The fall; positive is better."""
        return self.before - self.after

    @property
    def error(self) -> float:
        """Standard error of the fall."""
        return (self.interval[1] - self.interval[0]) / (2 * float(stats.norm.ppf(0.975)))


@dataclass(frozen=True)
class Excess:
    """Test whether a model predicts measured vehicles worse than its own vehicles with another seed.

    Attributes:
        p_value: of the total error, one-sided.
        channels: channel → its error, its noise floor, and the p-value, corrected for the number of channels.
    """

    p_value: float
    channels: Mapping[str, tuple[float, float, float]]

    def largest(self, level: float) -> list[str]:
        """Channels with significant excess, the clearest first; at least one."""
        order = sorted(self.channels, key=lambda name: self.channels[name][2])
        return [name for name in order if self.channels[name][2] <= level] or order[:1]


def score_vehicles(measured: Summary, runs: Sequence[Summary]) -> Scores:
    """Score every measured vehicle in every whole channel."""
    at = [number for number, column in enumerate(measured.columns) if column.is_whole and column.channel not in BASES]
    names = tuple(measured.columns[number].channel for number in at)
    truth = _values(*measured.rows(measured.ids), at, names)
    model = np.stack([_values(*run.rows(measured.ids), at, names) for run in runs])
    scale = np.array([CHANNELS[name].scale for name in names])
    return Scores(measured.ids, names, *_crps(truth / scale, model / scale))


def noise_floor(runs: Sequence[Summary], ids: frozenset[str] | None = None) -> float:
    """The error of the model against itself: each seed serves as the measurement once. NaN for fewer than three."""
    return _mean([one.error for one in _own_scores(runs, ids)])


def noise_floors(runs: Sequence[Summary]) -> dict[str, float]:
    """Noise floor of each group of channels."""
    groups = [one.by_group() for one in _own_scores(runs, None)]
    return {
        name: _mean([one.get(name, np.nan) for one in groups]) for name in dict.fromkeys(n for g in groups for n in g)
    }


def find_excess(scores: Scores, runs: Sequence[Summary]) -> Excess:
    """Test errors against those of the model's own seeds, each of which serves as the measurement once.

    If the model is right, the measurement is one more of these recordings: t prediction interval of a further value.
    """
    own = _own_scores(runs, None)
    if len(own) < _FEWEST_SEEDS:
        return Excess(1.0, {})

    def p_value(value: float, others: np.ndarray) -> float:
        spread = max(float(others.std(ddof=1)), _NEGLIGIBLE / 2) * np.sqrt(1 + 1 / len(others))
        return float(stats.t.sf((value - others.mean()) / spread, len(others) - 1))

    by_seed = [one.by_channel() for one in own]
    known = {
        name: np.array([one[name] for one in by_seed])
        for name, value in scores.by_channel().items()
        if np.isfinite([value, *(one[name] for one in by_seed)]).all()
    }
    errors = scores.by_channel()
    channels = {
        name: (errors[name], float(others.mean()), min(p_value(errors[name], others) * len(known), 1.0))
        for name, others in known.items()
    }
    return Excess(p_value(scores.error, np.array([one.error for one in own])), channels)


def _own_scores(runs: Sequence[Summary], ids: frozenset[str] | None) -> list[Scores]:
    if len(runs) < _FEWEST_SEEDS:
        return []
    found = [score_vehicles(run, [other for other in runs if other is not run]) for run in runs]
    return found if ids is None else [scores.of(ids) for scores in found]


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def compare_scores(before: Scores, after: Scores, draws: int = 200, seed: int = 5) -> Fall:
    """The fall of the error between two models, and what of it is chance.

    Vehicles and seeds are drawn with replacement together (bootstrap); seeds by their leave-one-out scores.
    """
    both = np.isfinite(before.table) & np.isfinite(after.table)
    first = np.where(both, before.table, np.nan)
    second = np.where(both, after.table, np.nan)
    names = before.channels
    rng, count = np.random.default_rng(seed), len(before.ids)
    seeds = len(before.by_seed)
    falls, groups = [], []
    for _ in range(draws if count else 0):
        rows, weight = rng.integers(count, size=count), rng.integers(seeds, size=seeds)
        shift = (before.by_seed[weight] - after.by_seed[weight]).mean(0) - (before.by_seed - after.by_seed).mean(0)
        drawn = np.where(both, first - second + (seeds - 1) * np.nan_to_num(shift), np.nan)[rows]
        parts = dict(zip(names, _means(drawn).tolist(), strict=True))
        falls.append(_total(parts))
        groups.append(_grouped(parts))
    low, high = np.nanquantile(falls, [0.025, 0.975]).tolist() if falls else (float("nan"), float("nan"))
    one, other = (dict(zip(names, _means(table).tolist(), strict=True)) for table in (first, second))
    worse = {}
    for group, value in _grouped(one).items():
        rise = _grouped(other).get(group, np.nan) - value
        spread = float(np.nanstd([drawn.get(group, np.nan) for drawn in groups])) if groups else np.inf
        if np.isfinite(rise) and rise > 2 * spread and rise > _NEGLIGIBLE:
            worse[group] = float(rise)
    return Fall(_total(one), _total(other), (low, high), worse)


def _values(sums: np.ndarray, weights: np.ndarray, at: Sequence[int], names: Sequence[str]) -> np.ndarray:
    """Values of vehicles (v, c): means, or numbers of events; NaN without exposure."""
    sums, weights = sums[:, at], weights[:, at]
    events = np.array([CHANNELS[name].is_event for name in names], bool)
    mean = np.divide(sums, weights, out=np.full(sums.shape, np.nan), where=weights > 0)
    return np.where(events, np.where(weights > 0, sums, np.nan), mean)


def _crps(truth: np.ndarray, model: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scores (v, c) of values (v, c) against an ensemble (s, v, c), and with each member left out (s, v, c)."""
    known = np.isfinite(model)
    count = known.sum(0)
    off = np.where(known, np.minimum(np.abs(model - truth), _LARGEST), 0.0)
    pairs = np.abs(model[:, None] - model[None])
    pairs = np.where(known[:, None] & known[None], np.minimum(pairs, _LARGEST), 0.0)
    of_member = pairs.sum(1)
    near, spread = off.sum(0), of_member.sum(0)
    enough = (count >= max(2, len(model) // 2)) & np.isfinite(truth)
    whole = _score(near, spread, count)
    left = _score(near - off, spread - 2 * of_member, count - known)
    return np.where(enough, whole, np.nan), np.where(enough, left, np.nan)


def _score(near: np.ndarray, spread: np.ndarray, count: np.ndarray) -> np.ndarray:
    n = np.maximum(count, 1)
    return near / n - spread / (2 * n * np.maximum(count - 1, 1))


def _means(table: np.ndarray) -> np.ndarray:
    """Mean of each channel (c,) over vehicles (v, c)."""
    known = np.isfinite(table)
    fewest = min(_FEWEST_VEHICLES, max(1, np.ceil(_FEWEST_SHARE * len(table))))
    count = known.sum(0)
    mean = np.where(known, table, 0.0).sum(0) / np.maximum(count, 1)
    return np.where(count >= fewest, mean, np.nan)


def _grouped(parts: Mapping[str, float]) -> dict[str, float]:
    groups: dict[str, list[float]] = {}
    for name, value in parts.items():
        if np.isfinite(value):
            groups.setdefault(CHANNELS[name].group, []).append(value)
    return {group: float(np.mean(values)) for group, values in groups.items()}


def _total(parts: Mapping[str, float]) -> float:
    groups = list(_grouped(parts).values())
    return float(np.mean(groups)) if groups else float("nan")
