"""How far two traffics are from each other, in one number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cosim.driver_discrepancy.summary import HEADWAY_BINS, LATERAL_BINS, SPEED_BINS, Summary

SCALES = {"speed": 0.5, "headway": 0.2, "lateral": 0.05, "counts": 5.0, "manners": 1.0}
UNITS = {"speed": "m/s", "headway": "s", "lateral": "m", "counts": "GEH", "manners": ""}
MANNERS = {
    "free_speed": 0.05,
    "free_speed_spread": 0.03,
    "standing_gap": 0.3,
    "headway": 0.2,
    "lateral": 0.05,
    "lateral_spread": 0.03,
    "lane_changes": 0.5,
    "u_turns": 2.0,
    "pull_outs": 3.0,
    "acceleration_noise": 0.1,
    "acceleration_memory": 0.1,
    "reaction_lag": 0.3,
    "startup_lag": 0.3,
}
"""Differences of statistics that count as one, in the statistics' units."""
_BINS = {"speed": SPEED_BINS, "headway": HEADWAY_BINS, "lateral": LATERAL_BINS}


def channels(one: Summary, other: Summary) -> dict[str, float]:
    """Distance in every channel, in its unit; NaN where nothing tells.

    Of speeds, headways and places in the lane it is the first Wasserstein distance (the mean way by which one
    distribution's mass has to move to become the other), of counts the mean GEH of the streets' hourly flows
    (UK Department for Transport, TAG unit M3.1), of manners the mean difference over its scale.
    """
    found = {name: _wasserstein(one, other, name) for name in _BINS}
    return {**found, "counts": _geh(one, other), "manners": _manners(one.statistics(), other.statistics())}


def error(parts: Mapping[str, float]) -> float:
    """The one number: the mean over channels of distance over scale."""
    told = [parts[name] / SCALES[name] for name in parts if np.isfinite(parts[name])]
    return float(np.mean(told)) if told else float("nan")


def mean_channels(one: Summary, others: Sequence[Summary]) -> dict[str, float]:
    """Distance of one traffic from several, channel by channel, on average."""
    rows = [channels(one, other) for other in others]
    return {name: _mean([row[name] for row in rows]) for name in SCALES}


def floor(others: Sequence[Summary]) -> float:
    """The error of the model against itself with other luck."""
    pairs = [(a, b) for a in range(len(others)) for b in range(a)]
    return float(np.mean([error(channels(others[a], others[b])) for a, b in pairs])) if pairs else float("nan")


def _wasserstein(one: Summary, other: Summary, name: str) -> float:
    bins = _BINS[name]
    first, second = one.histograms[name].sum(0), other.histograms[name].sum(0)
    if not first.sum() or not second.sum():
        return float("nan")
    apart = np.cumsum(first / first.sum() - second / second.sum())
    return float(np.abs(apart[:-1]).sum() * (bins[1] - bins[0]))


def _geh(one: Summary, other: Summary) -> float:
    names = np.unique(np.concatenate([one.edges[1], other.edges[1]]).astype(str))
    if not len(names):
        return float("nan")
    hourly = [_counted(summary.edges[1], names) * 3600 / max(summary.seconds, 1.0) for summary in (one, other)]
    return float(np.mean(np.sqrt(2 * (hourly[0] - hourly[1]) ** 2 / np.maximum(hourly[0] + hourly[1], 1e-9))))


def _counted(edges: np.ndarray, names: np.ndarray) -> np.ndarray:
    return np.bincount(np.searchsorted(names, edges.astype(str)), minlength=len(names)).astype(float)


def _manners(one: Mapping[str, float], other: Mapping[str, float]) -> float:
    return _mean([abs(one[name] - other[name]) / scale for name, scale in MANNERS.items()])


def _mean(values: Sequence[float]) -> float:
    told = [value for value in values if np.isfinite(value)]
    return float(np.mean(told)) if told else float("nan")
