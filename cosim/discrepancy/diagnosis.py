"""What a diagnosis found, and the one line that says it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cosim.discrepancy.budget import Budget, HeldOut, Judged
from cosim.discrepancy.data.split import Split
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.discrepancy.unexplained import EvidenceCell, Unexplained
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.words import FEW, Vocabulary, source_words, times, unexplained_words, unknown_words
from cosim.labels.bias import LabelFinding
from cosim.report.phrases import listed, p_words
from cosim.variants.worth import Worth
from sensors.sensor_model import SensorModel

_PLAIN = ("range_bias", "elevation_offset", "range_walk", "incidence_falloff", "random_dropout")


@dataclass(frozen=True, eq=False)
class Alternative:
    """A candidate of the first round: how much the BIC falls with it, and its own family-wise p-value."""

    effect: str
    delta_bic: float
    p_value: float

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Finding:
    """An effect that was missing.

    Attributes:
        effect: its name.
        params: fitted parameters, totals.
        ci95: intervals of those that are numbers.
        p_value: its own, family-wise, when it was added.
        error_before, error_after: on held-out frames, before and after it was added.
        also_possible: what explains the data as well.
    """

    effect: str
    params: Mapping[str, Any]
    ci95: Mapping[str, Any]
    p_value: float
    error_before: HeldOut
    error_after: HeldOut
    also_possible: tuple[str, ...]

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
        effects: what was missing, in the order in which it was found.
        ranking: candidates of the first round, the likeliest first.
        unknowns: what no candidate explains.
        unexplained: dependences that are still significant in the end.
        either_or: names of terms that these data cannot separate, the selected one first.
        evidence: the matrix channel × covariate, before and after the findings.
        smallest_detectable: amplitude of each effect that would have been seen with 80 % power.
        budget: where the error comes from.
        sensor: the improved model.
        split: which frames were fitted and which judged.
        spreads: standard deviations of what is merely not known of the drive, by name with its unit.
        labels: what labelled boxes say, where there are any; a missing label effect is in the improved model.
        notes: what the drive does not let one know, a sentence each.
        judged: the judging frames under the model as given and as it ends, for pages.
        refitted: of effects that were fitted along, by name their `params` and `ci95`.
        worth: what the findings are worth to a detector, where one was asked.
        settings: numbers that decided.
    """

    effects: tuple[Finding, ...]
    ranking: tuple[Alternative, ...]
    unknowns: tuple[UnknownEffect, ...]
    unexplained: tuple[Unexplained, ...]
    either_or: tuple[tuple[str, ...], ...]
    evidence: tuple[EvidenceCell, ...]
    smallest_detectable: Mapping[str, Mapping[str, float]]
    budget: Budget
    sensor: SensorModel
    split: Split
    spreads: Mapping[str, float] = field(default_factory=dict)
    sensor_out: str | None = None
    labels: LabelFinding | None = None
    notes: tuple[str, ...] = ()
    judged: Judged | None = None
    refitted: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    worth: Worth | None = None
    settings: Settings = DEFAULT

    @property
    def verdict(self) -> Literal["none", "missing", "ambiguous", "unknown"]:
        """What was found, in a word."""
        if self.unknowns:
            return "unknown"
        if any(one.also_possible for one in self.effects):
            return "ambiguous"
        if self.effects:
            return "missing"
        if self.unexplained or (self.above_floor is not None and self.above_floor > self.settings.at_floor):
            return "unknown"
        return "missing" if self.labels is not None and self.labels.verdict == "missing" else "none"

    @property
    def unknown(self) -> UnknownEffect | None:
        """The first of the unknowns."""
        return self.unknowns[0] if self.unknowns else None

    @property
    def error_before(self) -> float:
        """On held-out frames, of the model as it was given."""
        return self.budget.steps[0].error

    @property
    def error_after(self) -> float:
        """On held-out frames, of the improved model."""
        return self.budget.steps[-1].error

    @property
    def noise_floor(self) -> float | None:
        """The error of a model that is right up to noise."""
        return self.budget.floor

    @property
    def above_floor(self) -> float | None:
        """By what share the aligned error stands above the noise floor in the end; None if that is not known."""
        return self.budget.error_aligned / self.noise_floor - 1 if self.noise_floor else None

    def to_json(self) -> dict[str, Any]:
        """What `cosim diagnose --json` writes."""
        return {
            "verdict": self.verdict,
            "labels": self.labels.to_json() if self.labels else None,
            "effects": [one.to_json() for one in self.effects],
            "ranking": [one.to_json() for one in self.ranking],
            "unknown": self.unknown.to_json() if self.unknown else None,
            "unknowns": [one.to_json() for one in self.unknowns],
            "unexplained": [one.to_json() for one in self.unexplained],
            "either_or": [list(names) for names in self.either_or],
            "evidence": [cell.to_json() for cell in self.evidence],
            "smallest_detectable": {name: dict(values) for name, values in self.smallest_detectable.items()},
            "error_before": self.error_before,
            "error_after": self.error_after,
            "error_aligned": self.budget.error_aligned,
            "budget": dict(self.budget.parts),
            "noise_floor": self.noise_floor,
            "spreads": dict(self.spreads),
            "notes": list(self.notes),
            **({"worth": self.worth.to_json()} if self.worth else {}),
            "sensor_out": self.sensor_out,
        }

    def write_sensor(self, path: str | Path) -> Path:
        """Write the improved sensor to a file, and unknown effects as plug-ins beside it; returns the path.

        Raises:
            OutputError: the folder cannot be written.
        """
        from cosim.discrepancy.unknown.source import effect_source
        from cosim.drives.sensor_files import write_sensor

        own = {one.name: (one.class_name, effect_source(one)) for one in self.unknowns}
        return write_sensor(self.sensor, Path(path), own)

    def __str__(self) -> str:
        return headline(self, Vocabulary([type(effect) for effect in self.sensor.effects]))


def headline(found: Diagnosis, words: Vocabulary, left: Sequence[str] = ()) -> str:
    """The line that `cosim diagnose` says; `left` names what judging frames show although nothing was found."""
    parts = [_found(one, words) for one in found.effects]
    if parts:
        ambiguous = any(one.also_possible for one in found.effects)
        parts[0] = f"{'ambiguous' if ambiguous else 'missing'}: {parts[0]}"
    parts += [f"unknown: {unknown_words(one)}" for one in found.unknowns]
    if found.labels is not None and found.labels.verdict == "missing":
        parts.append(str(found.labels))
    if found.unexplained:
        parts.append(f"unexplained: {listed([unexplained_words(one) for one in found.unexplained[:FEW]])}")
    elif left:
        parts.append(f"judging frames still show {listed(list(left[:FEW]))}")
    if not parts:
        smallest = smallest_words(found, words, most=3)
        parts.append(f"nothing missing that would show{f'; would have seen {smallest}' if smallest else ''}")
    return f"{'; '.join(parts)}; {budget_words(found, is_complete=found.verdict == 'none' and not left)}"


def budget_words(found: Diagnosis, *, is_complete: bool) -> str:
    """Where the error comes from: `error 1.32, 4.3 × the noise floor: 3.1 of it poses, 0.2 objects, nothing missing`.

    Args:
        found: the diagnosis.
        is_complete: whether nothing is missing, which is said then.
    """
    budget, said = found.budget, f"{error_words(found)} {found.error_before:.3f}"
    if not budget.floor:
        fall = _fall(found.error_before, found.error_after)
        return f"{error_words(found)} {fall}; what noise alone would make is not known"
    made = source_words(budget.parts, budget.floor, is_complete=is_complete)
    aligned = _fall(budget.given_aligned, budget.error_aligned)
    said += f", {times(budget.error / budget.floor)} the noise floor{made and f': {made}'}"
    if found.effects or found.unknowns:
        said += f"; {found.error_after:.3f} with what was found"
    return f"{said}; aligned {aligned}, {floor_words(found)}"


def _fall(before: float, after: float) -> str:
    """An error, and what it becomes."""
    same = round(before, 3) == round(after, 3)
    return f"{before:.3f}" if same else f"{before:.3f} → {after:.3f}"


def floor_words(found: Diagnosis) -> str:
    """Where the aligned error ends beside its noise floor; empty where that is not known."""
    above = found.above_floor
    if above is None:
        return ""
    return "at the floor" if above <= found.settings.at_floor else f"{times(1 + above)} the floor"


def error_words(found: Diagnosis) -> str:
    """Which error it is that a diagnosis tells."""
    return "held-out error" if found.split.is_held_out else "error on the fitted frames themselves"


def smallest_words(found: Diagnosis, words: Vocabulary, most: int) -> str:
    """Smallest amplitudes that would have been seen, of the first few effects, plain ones before others."""
    rows = [row for row in smallest_rows(found) if words.is_possible(*row)]
    rows.sort(key=lambda row: _PLAIN.index(row[0]) if row[0] in _PLAIN else len(_PLAIN))
    said = [f"{effect} from {words.quantity(effect, name, value)}" for effect, name, value in rows[:most]]
    return ", ".join(said)


def smallest_rows(found: Diagnosis) -> list[tuple[str, str, float]]:
    """Effect, amplitude and smallest detectable value, where it is above 0."""
    return [
        (effect, name, value)
        for effect, values in sorted(found.smallest_detectable.items())
        for name, value in values.items()
        if np.isfinite(value) and value > 0
    ]


def _found(one: Finding, words: Vocabulary) -> str:
    values = words.parameters(one.effect, one.params, one.ci95)
    alike = f"; not separable from {', '.join(one.also_possible)}" if one.also_possible else ""
    return f"{one.effect} ({values}), {p_words(one.p_value)}{alike}"
