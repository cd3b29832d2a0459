"""What a diagnosis found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cosim.discrepancy.data.split import Split
from cosim.discrepancy.gate import Verdict
from cosim.discrepancy.labels import LabelFinding
from cosim.discrepancy.unknown import Shape, class_name, effect_name, effect_source
from cosim.discrepancy.validation import HeldOut
from sensors.sensor_model import SensorModel


@dataclass(frozen=True, eq=False)
class Alternative:
    """A candidate of the first round: how much the BIC falls with it, and its family-wise p-value."""

    effect: str
    delta_bic: float
    p_value: float

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"effect": self.effect, "delta_bic": self.delta_bic, "p_value": self.p_value}


@dataclass(frozen=True, eq=False)
class Finding:
    """An effect that was missing.

    Attributes:
        effect: its name.
        params: fitted parameters, totals.
        ci95: intervals of those that are numbers.
        p_value: family-wise, when it was added.
        error_before, error_after: on held-out frames, before and after it was added.
        also_possible: what explains the data as well, within ΔBIC 10.
        delta_bic: how much the BIC fell.
    """

    effect: str
    params: Mapping[str, Any]
    ci95: Mapping[str, Any]
    p_value: float
    error_before: HeldOut
    error_after: HeldOut
    also_possible: tuple[str, ...]
    delta_bic: float

    def settled(self, params: Mapping[str, Any], ci95: Mapping[str, Any]) -> Finding:
        """With the parameters of the last fit."""
        return replace(self, params=params, ci95=ci95)

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "effect": self.effect,
            "params": dict(self.params),
            "ci95": dict(self.ci95),
            "p_value": self.p_value,
            "error_before": self.error_before.error,
            "error_after": self.error_after.error,
            "also_possible": list(self.also_possible),
        }


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The outcome.

    Attributes:
        verdict: none, missing, ambiguous or unknown.
        effects: what was missing, in the order in which it was found.
        ranking: candidates of the first round, the likeliest first.
        unknown: what no candidate explains, or None.
        smallest_detectable: amplitude of each effect that would have been seen with 80 % power.
        error_before, error_after: on held-out frames.
        noise_floor: the error of a model that is right up to noise.
        sensor: the improved model.
        split: which frames were fitted and which judged.
        map_off_m: how far spots of the twin's map stand off by errors of their own, a standard deviation [m]; 0 where
            it is exact, or says itself how sure it is.
        labels: what labelled boxes say, where there are any; a missing label effect is in the improved model.
        notes: what the drive does not let one know, a sentence each.
    """

    verdict: Literal["none", "missing", "ambiguous", "unknown"]
    effects: tuple[Finding, ...]
    ranking: tuple[Alternative, ...]
    unknown: Shape | None
    smallest_detectable: Mapping[str, Mapping[str, float]]
    error_before: float
    error_after: float
    noise_floor: float | None
    sensor: SensorModel
    split: Split
    map_off_m: float = 0.0
    sensor_out: str | None = None
    labels: LabelFinding | None = None
    notes: tuple[str, ...] = ()

    @property
    def above_floor(self) -> float | None:
        """By what share the error stands above the noise floor in the end; None where the floor is not known."""
        return self.error_after / self.noise_floor - 1 if self.noise_floor else None

    @classmethod
    def of(
        cls,
        sensor: SensorModel,
        findings: Sequence[Finding],
        ranking: Sequence[Alternative],
        verdict: Verdict,
        errors: Sequence[HeldOut],
        split: Split,
        unknown: Shape | None,
        map_off_m: float,
        notes: tuple[str, ...],
    ) -> Diagnosis:
        """From the parts."""
        ambiguous = any(finding.also_possible for finding in findings)
        return cls(
            verdict="unknown" if unknown else "ambiguous" if ambiguous else "missing" if findings else "none",
            effects=tuple(findings),
            ranking=tuple(ranking),
            unknown=unknown,
            smallest_detectable=_smallest(verdict),
            error_before=errors[0].error,
            error_after=errors[-1].error,
            noise_floor=errors[-1].floor,
            sensor=sensor,
            split=split,
            map_off_m=map_off_m,
            notes=notes,
        )

    def to_json(self) -> dict[str, Any]:
        """What `cosim diagnose --json` writes."""
        return {
            "verdict": self.verdict,
            "labels": self.labels.to_json() if self.labels else None,
            "effects": [one.to_json() for one in self.effects],
            "ranking": [one.to_json() for one in self.ranking],
            "unknown": self.unknown.to_json() if self.unknown else None,
            "smallest_detectable": {name: dict(values) for name, values in self.smallest_detectable.items()},
            "error_before": self.error_before,
            "error_after": self.error_after,
            "noise_floor": self.noise_floor,
            "map_off_m": self.map_off_m,
            "notes": list(self.notes),
            "sensor_out": self.sensor_out,
        }

    def write_sensor(self, path: str | Path) -> Path:
        """Write the improved sensor to a file, and an unknown effect as a plug-in beside it; returns the path.

        Raises:
            OutputError: the folder cannot be written.
        """
        from cosim.discrepancy.sensor_out import write_sensor

        unknown = self.unknown
        own = {} if unknown is None else {effect_name(unknown): (class_name(unknown), effect_source(unknown))}
        return write_sensor(self.sensor, Path(path), own)

    def __str__(self) -> str:
        from cosim.discrepancy.report.sentences import Vocabulary, headline

        return headline(self, Vocabulary([type(effect) for effect in self.sensor.effects]))


def _smallest(verdict: Verdict) -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {}
    for one in verdict.statistics:
        direction = one.direction
        if direction.amplitude and np.isfinite(one.smallest):
            mine = found.setdefault(direction.effect, {})
            mine[direction.amplitude] = min(one.smallest, mine.get(direction.amplitude, np.inf))
    return found
