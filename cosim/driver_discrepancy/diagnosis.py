"""Result of a diagnosis of driver behaviour."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from cosim.capture.config import RunConfig
from cosim.driver_discrepancy.comparison import StatisticRow, TrafficComparison


@dataclass(frozen=True, eq=False)
class Candidate:
    """A behaviour of the first round.

    Attributes:
        behaviour: its name.
        delta_bic: fall of chi² less ln n per parameter, n vehicles; by simulation where it was `fitted`, else twice
            the cross-fitted gain of its slopes.
        p_value: family-wise, of the columns that show it.
        fitted: whether it was fitted by simulation.
    """

    behaviour: str
    delta_bic: float
    p_value: float
    fitted: bool

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"effect": self.behaviour, "delta_bic": self.delta_bic, "p_value": self.p_value}


@dataclass(frozen=True, eq=False)
class TrafficFinding:
    """A behaviour that was missing.

    Attributes:
        behaviour: its name.
        params: fitted parameters, totals.
        before: what they were in the model.
        ci95: their intervals.
        p_value: family-wise, when it was added.
        error_before, error_after: on held-out vehicles, before and after it was added.
        also_possible: behaviours that explain the data as well, within two standard errors of the gain.
        shown_by: channels with their values measured, before and after.
        fall_ci95: 95 % interval of the fall of the held-out error, over seeds and vehicles.
        worse: groups of channels whose held-out error rises significantly, with the rise over their scale.
        streets: edges that it applies to; empty for the whole town.
    """

    behaviour: str
    params: Mapping[str, float]
    before: Mapping[str, float]
    ci95: Mapping[str, list[float]]
    p_value: float
    error_before: float
    error_after: float
    also_possible: tuple[str, ...]
    shown_by: Mapping[str, tuple[float, float, float]]
    fall_ci95: tuple[float, float] = (float("nan"), float("nan"))
    worse: Mapping[str, float] = field(default_factory=dict)
    streets: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "effect": self.behaviour,
            "params": dict(self.params),
            "ci95": dict(self.ci95),
            "p_value": self.p_value,
            "error_before": self.error_before,
            "error_after": self.error_after,
            "also_possible": list(self.also_possible),
            "fall_ci95": list(self.fall_ci95),
            "worse": dict(self.worse),
            **({"streets": list(self.streets)} if self.streets else {}),
        }


@dataclass(frozen=True, eq=False)
class TrafficDiagnosis:
    """The outcome.

    Attributes:
        verdict: none, missing, ambiguous or unknown.
        effects: what was missing, in the order found.
        ranking: candidates of the first round, the most likely first.
        smallest_detectable: change of each parameter that would have been seen with 80 % power.
        before, after: comparisons of the model as given and improved, all vehicles.
        error_before, error_after: on held-out vehicles.
        noise_floor: the error of the model against itself with other seeds, on the same vehicles.
        config: the improved configuration.
        unexplained: columns that still differ significantly, one of each channel, the clearest first; then channels
            in which only the error of single vehicles is above its floor.
        simulations: how many were run.
        config_out: where the configuration was written.
    """

    verdict: Literal["none", "missing", "ambiguous", "unknown"]
    effects: tuple[TrafficFinding, ...]
    ranking: tuple[Candidate, ...]
    smallest_detectable: Mapping[str, Mapping[str, float]]
    before: TrafficComparison
    after: TrafficComparison
    error_before: float
    error_after: float
    noise_floor: float
    config: RunConfig
    unexplained: tuple[StatisticRow, ...]
    simulations: int
    config_out: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Contents of the file of `cosim traffic-diagnose --json`: the keys of `cosim diagnose`, and further ones."""
        unknowns = [_unknown(row) for row in self.unexplained]
        return {
            "verdict": self.verdict,
            "effects": [one.to_json() for one in self.effects],
            "ranking": [one.to_json() for one in self.ranking],
            "unknown": unknowns[0] if unknowns else None,
            "unknowns": unknowns,
            "unexplained": unknowns,
            "groups": {"before": dict(self.before.channels), "after": dict(self.after.channels)},
            "smallest_detectable": {name: dict(values) for name, values in self.smallest_detectable.items()},
            "error_before": self.error_before,
            "error_after": self.error_after,
            "noise_floor": self.noise_floor,
            "config_out": self.config_out,
            "statistics": [row.to_json() for row in self.after.statistics],
            "simulations": self.simulations,
            "notes": list(self.before.notes),
        }


def _unknown(row: StatisticRow) -> dict[str, Any]:
    return {
        "channel": row.name,
        "covariates": [row.condition] if row.condition else [],
        "level": row.level or None,
        "form": row.difference,
        "size": row.measured - row.model,
        "unit": row.unit,
        "r2": None,
        "p_value": row.p_value,
    }
