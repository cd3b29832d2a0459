"""What trajectories say about each of their drivers, in few enough numbers to compare many simulations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cosim.driver_discrepancy import manners
from cosim.driver_discrepancy.placed import FOUR_WHEELS, Placed, kind_of

SPEED_BINS = np.arange(0.5, 40.01, 0.5)
HEADWAY_BINS = np.arange(0.0, 6.01, 0.1)
LATERAL_BINS = np.arange(-1.0, 1.001, 0.02)
MEANS = (
    "free_speed",
    "standing_gap",
    "headway",
    "lateral",
    "lane_changes",
    "u_turns",
    "pull_outs",
    "acceleration_noise",
    "acceleration_memory",
    "startup_lag",
)
COUNTS = ("lane_changes", "u_turns", "pull_outs")
"""Those of `MEANS` that are events over exposure."""
MEDIANS = ("standing_gap", "headway")
"""Those of `MEANS` of which the middle vehicle counts: some stand or drive behind another without following him."""
SPREADS = {"free_speed_spread": "free_speed", "lateral_spread": "lateral"}
STATISTICS = (
    "free_speed",
    "free_speed_spread",
    "standing_gap",
    "headway",
    "lateral",
    "lateral_spread",
    "lane_changes",
    "u_turns",
    "pull_outs",
    "acceleration_noise",
    "acceleration_memory",
    "reaction_lag",
    "startup_lag",
)
LAGS_S = np.arange(0.0, 3.01, 0.1)


@dataclass(frozen=True, eq=False)
class Summary:
    """Vehicle by vehicle, v of them.

    Attributes:
        ids: their names.
        sums, weights: of every statistic in `MEANS`, (v,) each; their ratio is the vehicle's value.
        squares: of the same, weight times the square of the vehicle's value.
        histograms: `speed`, `headway`, `lateral`: (v, bins) seconds.
        lagged: (v, lags) covariance of the acceleration with the leader's so much earlier.
        edges: vehicle row and edge of each entry into an edge.
        seconds: of the recording.
    """

    ids: tuple[str, ...]
    sums: Mapping[str, np.ndarray]
    weights: Mapping[str, np.ndarray]
    histograms: Mapping[str, np.ndarray]
    lagged: np.ndarray
    edges: tuple[np.ndarray, np.ndarray]
    seconds: float

    def of(self, ids: frozenset[str]) -> Summary:
        """That of some vehicles alone."""
        keep = np.array([name in ids for name in self.ids], bool)
        row = np.cumsum(keep) - 1
        mine = keep[self.edges[0]]
        return Summary(
            ids=tuple(name for name in self.ids if name in ids),
            sums={name: values[keep] for name, values in self.sums.items()},
            weights={name: values[keep] for name, values in self.weights.items()},
            histograms={name: values[keep] for name, values in self.histograms.items()},
            lagged=self.lagged[keep],
            edges=(row[self.edges[0][mine]], self.edges[1][mine]),
            seconds=self.seconds,
        )

    def statistics(self) -> dict[str, float]:
        """Every statistic over all vehicles; NaN where nothing tells."""
        found = {name: _ratio(self.sums[name], self.weights[name]) for name in MEANS}
        found |= {name: float(np.median(self.values(name))) for name in MEDIANS if len(self.values(name))}
        found |= {name: self._spread(of) for name, of in SPREADS.items()}
        return {**found, "reaction_lag": _centre(self.lagged.sum(0))}

    def count(self, name: str) -> float:
        """Events, or vehicles that tell about a statistic."""
        if name in COUNTS:
            return float(self.sums[name].sum())
        if name == "reaction_lag":
            return float((np.abs(self.lagged).sum(1) > 0).sum())
        return float((self.weights[SPREADS.get(name, name)] > 0).sum())

    def values(self, name: str) -> np.ndarray:
        """The values of those vehicles that tell about one of `MEANS`."""
        told = self.weights[name] > 0
        return self.sums[name][told] / self.weights[name][told]

    def _spread(self, name: str) -> float:
        weight = self.weights[name]
        told = weight > 0
        if told.sum() < 3:
            return float("nan")
        value = self.sums[name][told] / weight[told]
        mean = np.average(value, weights=weight[told])
        return float(np.sqrt(np.average((value - mean) ** 2, weights=weight[told])))


def summarise(placed: Placed) -> Summary:
    """The summary of four-wheeled vehicles; others take part in traffic only."""
    tracks = placed.tracks
    kinds = kind_of(tracks, placed.network)
    told = np.isin(kinds, FOUR_WHEELS)
    count = len(tracks.ids)
    parts = {
        "free_speed": manners.free_speed(placed),
        "standing_gap": manners.standing_gap(placed),
        "headway": manners.headway(placed),
        "lateral": manners.lateral(placed),
        "lane_changes": manners.lane_changes(placed),
        "u_turns": manners.u_turns(placed),
        "pull_outs": manners.pull_outs(placed),
        "acceleration_noise": manners.acceleration_noise(placed),
        "acceleration_memory": manners.acceleration_memory(placed),
        "startup_lag": manners.startup_lag(placed),
    }
    rows, edges = manners.entries(placed)
    whole = Summary(
        ids=tracks.ids,
        sums={name: sums for name, (sums, _) in parts.items()},
        weights={name: weights for name, (_, weights) in parts.items()},
        histograms={
            "speed": _histogram(tracks.vehicle, count, *manners.speeds(placed), SPEED_BINS),
            "headway": _histogram(tracks.vehicle, count, *manners.headways(placed), HEADWAY_BINS),
            "lateral": _histogram(tracks.vehicle, count, *manners.laterals(placed), LATERAL_BINS),
        },
        lagged=manners.lagged(placed, LAGS_S),
        edges=(rows, edges),
        seconds=tracks.seconds,
    )
    return whole.of(frozenset(name for name, mine in zip(tracks.ids, told, strict=True) if mine))


def _ratio(sums: np.ndarray, weights: np.ndarray) -> float:
    total = float(weights.sum())
    return float(sums.sum()) / total if total > 0 else float("nan")


def _centre(lagged: np.ndarray) -> float:
    """Lag at the middle of the hump of a covariance [s]."""
    peak = float(lagged.max()) if len(lagged) else 0.0
    if peak <= 0:
        return float("nan")
    top = np.maximum(lagged - peak / 2, 0.0)
    return float((top * LAGS_S[: len(top)]).sum() / top.sum())


def _histogram(vehicle: np.ndarray, count: int, rows: np.ndarray, values: np.ndarray, bins: np.ndarray) -> np.ndarray:
    cell = np.clip(np.searchsorted(bins, values, side="right"), 0, len(bins))
    flat = np.bincount(vehicle[rows] * (len(bins) + 1) + cell, minlength=count * (len(bins) + 1))
    return flat.reshape(count, len(bins) + 1).astype(float)
