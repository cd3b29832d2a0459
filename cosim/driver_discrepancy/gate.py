"""Whether measured traffic differs from the model's by more than luck does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.driver_discrepancy.behaviours import BEHAVIOURS, Behaviour
from cosim.driver_discrepancy.settings import DEFAULT, TrafficSettings
from cosim.driver_discrepancy.summary import COUNTS, MEANS, MEDIANS, SPREADS, STATISTICS, Summary

RESOLUTION = {
    "free_speed": 0.012,
    "free_speed_spread": 0.012,
    "standing_gap": 0.10,
    "headway": 0.08,
    "lateral": 0.012,
    "lateral_spread": 0.010,
    "lane_changes": 0.15,
    "u_turns": 0.0,
    "pull_outs": 0.0,
    "acceleration_noise": 0.04,
    "acceleration_memory": 0.035,
    "reaction_lag": 0.12,
    "startup_lag": 0.10,
}
"""Differences so small are the simulator's, not drivers': added to the luck in squares."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Measured against modelled, statistic by statistic, k of them that both tell.

    Attributes:
        names: of the statistics.
        measured, model: (k,); the model's is the mean over seeds.
        sigma: (k,) standard deviation of their difference if the model is right.
        freedom: degrees of freedom of sigma.
        luck: (seeds, k) standardised deviations of single seeds.
    """

    names: tuple[str, ...]
    measured: np.ndarray
    model: np.ndarray
    sigma: np.ndarray
    freedom: float
    luck: np.ndarray

    @property
    def z(self) -> np.ndarray:
        """Standardised differences (k,)."""
        return (self.measured - self.model) / self.sigma

    @classmethod
    def of(cls, measured: Summary, runs: Sequence[Summary], by: TrafficSettings = DEFAULT) -> Evidence:
        """From the measured summary and the model's, a seed each.

        The variance of a statistic is that between seeds and that between measured vehicles, pooled: each vehicle is
        one fact, however many samples it has, and a simulation another.
        """
        mine, rows = measured.statistics(), [run.statistics() for run in runs]
        names = tuple(name for name in STATISTICS if _told(name, measured, runs, mine, rows, by))
        model = np.array([[row[name] for name in names] for row in rows], float).reshape(len(runs), len(names))
        count, mean = len(runs), model.mean(0)
        between = model.var(0, ddof=1) if count > 1 else np.zeros(len(names))
        vehicles = np.array([_variance(measured, name) for name in names], float)
        weight = np.where(np.isfinite(vehicles), by.gate.vehicle_freedom, 0.0)
        pooled = (weight * np.nan_to_num(vehicles) + (count - 1) * between) / np.maximum(weight + count - 1, 1)
        floor = np.array([_resolution(name, measured) for name in names], float)
        spread = np.sqrt(np.maximum(between, 1e-18))
        return cls(
            names=names,
            measured=np.array([mine[name] for name in names], float),
            model=mean,
            sigma=np.sqrt(pooled * (1 + 1 / count) + floor**2),
            freedom=by.gate.vehicle_freedom + count - 1,
            luck=(model - mean) / spread * np.sqrt(count / max(count - 1, 1)),
        )


@dataclass(frozen=True, eq=False)
class Verdict:
    """What the gate says.

    Attributes:
        p_value: family-wise: the chance that any statistic would differ so much if nothing were missing.
        by_behaviour: the same for the statistics that show a behaviour.
        by_statistic: the same for each statistic.
        critical: |z| that luck exceeds in any statistic as often as the level says.
    """

    p_value: float
    by_behaviour: Mapping[str, float]
    by_statistic: Mapping[str, float]
    critical: float


def run_gate(evidence: Evidence, rng: np.random.Generator, by: TrafficSettings = DEFAULT) -> Verdict:
    """Max-T over all statistics, family-wise.

    The null distribution of the largest |z| is drawn with the correlations that the seeds show (multiplier bootstrap,
    Chernozhukov, Chetverikov and Kato, Ann. Statist. 2013), a share of them taken for chance, and Student's tails.
    """
    kinds, draws, correlated = len(evidence.names), by.gate.draws, by.gate.correlated
    if not kinds:
        return Verdict(1.0, dict.fromkeys(BEHAVIOURS, 1.0), {}, float("inf"))
    shared = rng.standard_normal((draws, len(evidence.luck))) @ evidence.luck / np.sqrt(len(evidence.luck))
    drawn = np.sqrt(correlated) * shared + np.sqrt(1 - correlated) * rng.standard_normal((draws, kinds))
    drawn /= np.sqrt(rng.chisquare(evidence.freedom, (draws, kinds)) / evidence.freedom)
    largest = np.abs(drawn).max(1)
    size = np.abs(evidence.z)
    p_values = (1 + (largest[:, None] >= size).sum(0)) / (1 + draws)
    by_statistic = dict(zip(evidence.names, p_values.tolist(), strict=True))
    by_behaviour = {
        name: min((by_statistic[one] for one in behaviour.statistics if one in by_statistic), default=1.0)
        for name, behaviour in BEHAVIOURS.items()
    }
    return Verdict(float(p_values.min()), by_behaviour, by_statistic, float(np.quantile(largest, 1 - by.level)))


def smallest(
    evidence: Evidence,
    verdict: Verdict,
    behaviour: Behaviour,
    slopes: np.ndarray,
    by: TrafficSettings = DEFAULT,
) -> dict[str, float]:
    """Change of each parameter that would have been seen with 80 % power.

    Args:
        evidence: of the model that nothing is missing from.
        verdict: its gate's.
        behaviour: whose parameters.
        slopes: (k, parameters) change of statistics with them.
        by: numbers that decide.
    """
    found = {}
    rows = [evidence.names.index(name) for name in behaviour.statistics if name in evidence.names]
    for column, knob in enumerate(behaviour.knobs):
        steepest = max((abs(slopes[row, column]) / evidence.sigma[row] for row in rows), default=0.0)
        if steepest > 0:
            found[knob.name] = float((verdict.critical + by.power) / steepest)
    return found


def _told(
    name: str,
    measured: Summary,
    runs: Sequence[Summary],
    mine: Mapping[str, float],
    rows: Sequence[Mapping[str, float]],
    by: TrafficSettings,
) -> bool:
    if not np.isfinite(mine[name]) or not all(np.isfinite(row[name]) for row in rows):
        return False
    least = by.gate.fewest_of_medians if name in MEDIANS else by.gate.fewest
    return name in COUNTS or min(one.count(name) for one in (measured, *runs)) >= least


def _variance(summary: Summary, name: str) -> float:
    """Variance of a statistic from one vehicle to another, by linearisation; NaN where that is not known."""
    if name in SPREADS:
        return summary.statistics()[name] ** 2 / (2 * max(summary.count(name) - 1, 1))
    if name not in MEANS:
        return float("nan")
    if name in MEDIANS:
        values = summary.values(name)
        apart = 1.4826 * float(np.median(np.abs(values - np.median(values))))
        return np.pi / 2 * apart**2 / len(values)
    sums, weights = summary.sums[name], summary.weights[name]
    total = weights.sum()
    return float((((sums - sums.sum() / total * weights) / total) ** 2).sum()) if total > 0 else float("nan")


def _resolution(name: str, measured: Summary) -> float:
    """The smallest difference that may be drivers'; of rare events, one event."""
    if name in ("u_turns", "pull_outs"):
        return 1.0 / max(float(measured.weights[name].sum()), 1e-9)
    return RESOLUTION[name]
