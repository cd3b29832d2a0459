"""What a diagnosis of driver behaviour found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from cosim.capture.config import RunConfig
from cosim.driver_discrepancy.comparison import TrafficComparison


@dataclass(frozen=True, eq=False)
class Candidate:
    """A behaviour of the first round: how much the BIC falls with it, its family-wise p-value, and the error with it.

    Attributes:
        behaviour: its name.
        delta_bic: fall of chi² less ln n a parameter, n vehicles; by simulation where it was `fitted`, else as its
            slopes promise.
        p_value: of the statistics that show it.
        fitted: whether it was.
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
        also_possible: what explains the data as well, within ΔBIC 10.
        shown_by: statistics with their values measured, before and after.
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
        }


@dataclass(frozen=True, eq=False)
class TrafficDiagnosis:
    """The outcome.

    Attributes:
        verdict: none, missing or ambiguous.
        effects: what was missing, in the order found.
        ranking: candidates of the first round, the likeliest first.
        smallest_detectable: change of each parameter that would have been seen with 80 % power.
        before, after: comparisons of the model as given and improved, all vehicles.
        error_before, error_after: on held-out vehicles.
        noise_floor: the error of the model against itself with other luck, on the same vehicles.
        config: the improved configuration.
        unexplained: statistics that still differ by more than luck and that no behaviour explains.
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
    unexplained: tuple[str, ...]
    simulations: int
    config_out: str | None = None

    def to_json(self) -> dict[str, Any]:
        """What `cosim traffic-diagnose --json` writes: the keys of `cosim diagnose`, and some of its own."""
        left = self.unexplained
        unknown = {"channel": "traffic", "covariates": [], "form": f"{', '.join(left)} differ", "r2": None}
        return {
            "verdict": self.verdict,
            "effects": [one.to_json() for one in self.effects],
            "ranking": [one.to_json() for one in self.ranking],
            "unknown": unknown if left else None,
            "smallest_detectable": {name: dict(values) for name, values in self.smallest_detectable.items()},
            "error_before": self.error_before,
            "error_after": self.error_after,
            "noise_floor": self.noise_floor,
            "config_out": self.config_out,
            "statistics": [row.to_json() for row in self.after.statistics],
            "simulations": self.simulations,
            "notes": list(self.before.notes),
        }
