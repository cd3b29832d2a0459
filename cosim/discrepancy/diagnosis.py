"""The outcome of a diagnosis, and its summary in one line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy import stats

from cosim.discrepancy.budget import Budget, FramePairs, HeldOut
from cosim.discrepancy.data.split import Split
from cosim.discrepancy.evidence_matrix import EvidenceCell
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.discrepancy.unexplained import Unexplained
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
    """A missing effect of the catalogue.

    Attributes:
        effect: name.
        params: fitted parameters; totals where the sensor had the effect already.
        ci95: intervals of numeric parameters.
        p_value: family-wise, when it was added.
        error_before, error_after: of the model before and after it was added, on held-out frames.
        also_possible: effects that explain the data equally well.
    """

    effect: str
    params: Mapping[str, Any]
    ci95: Mapping[str, Any]
    p_value: float
    error_before: HeldOut
    error_after: HeldOut
    also_possible: tuple[str, ...]

    def to_json(self, words: Vocabulary | None = None) -> dict[str, Any]:
        """Plain values; None for parameters that cannot be determined, as far as `words` has their bounds."""
        params = words.determined(self.effect, self.params, self.ci95) if words else dict(self.params)
        return {
            "effect": self.effect,
            "params": params,
            "ci95": dict(self.ci95),
            "p_value": self.p_value,
            "error_before": self.error_before.error,
            "error_after": self.error_after.error,
            "also_possible": list(self.also_possible),
        }


@dataclass(frozen=True)
class ErrorChange:
    """The change of the held-out error by one finding.

    Attributes:
        name: of the effect.
        before, after: errors, aligned where poses, objects and map were fitted.
        mean, half_interval: of the changes of single frames; NaN with fewer than two frames.
        is_needed: whether the error of all findings together rises without this one.
    """

    name: str
    before: float
    after: float
    mean: float
    half_interval: float
    is_needed: bool = False

    @property
    def is_fall(self) -> bool:
        """Whether the error is lower with the finding: than before it, or than with all others but without it."""
        return self.after < self.before or self.is_needed

    @property
    def is_significant(self) -> bool:
        """Whether the interval of the changes of single frames excludes 0."""
        return abs(self.mean) > self.half_interval


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The outcome.

    Attributes:
        effects: missing effects of the catalogue, in the order in which they were added.
        ranking: candidates of the first round, the most likely first.
        unknowns: dependences that no candidate explains.
        unexplained: dependences that are still significant in the end.
        either_or: names of terms that these data cannot separate, the selected one first.
        evidence: the matrix channel × covariate, before and after the findings.
        smallest_detectable: amplitude of each effect that would have been detected with 80 % power.
        budget: sources of the error.
        sensor: the improved model.
        split: frames to fit and held-out frames.
        spreads: standard deviations of the nuisance parameters, by name with unit.
        labels: result for labelled boxes if there are any; a missing label effect is in the improved model.
        notes: what these data cannot determine, a sentence each.
        frame_pairs: held-out frames under the initial and the final model, for pages.
        refitted: `params` and `ci95` of the effects of the sensor that were refitted, by name.
        worth: the change of a detector's average precision by each finding, if requested.
        needed: names of findings that lower the error only together with later ones.
        settings: numeric choices.
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
    frame_pairs: FramePairs | None = None
    refitted: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    worth: Worth | None = None
    needed: frozenset[str] = frozenset()
    settings: Settings = DEFAULT

    @property
    def verdict(self) -> Literal["none", "missing", "ambiguous", "unknown"]:
        """The result in a word; never `none` while anything is listed or the aligned error is above the floor."""
        if self.unknowns:
            return "unknown"
        if any(finding.also_possible for finding in self.effects):
            return "ambiguous"
        if self.effects:
            return "missing"
        if self.unexplained or self.is_above_floor:
            return "unknown"
        if self.labels is not None and self.labels.verdict == "missing":
            return "missing"
        return "none"

    @property
    def unknown(self) -> UnknownEffect | None:
        """The first unknown effect."""
        return self.unknowns[0] if self.unknowns else None

    @property
    def error_before(self) -> float:
        """Held-out error of the initial model."""
        return self.budget.steps[0].error

    @property
    def error_after(self) -> float:
        """Held-out error of the improved model."""
        return self.budget.steps[-1].error

    @property
    def noise_floor(self) -> float | None:
        """Error of a model that is correct up to noise."""
        return self.budget.floor

    @property
    def above_floor(self) -> float | None:
        """Final aligned error relative to the noise floor, less 1; None without a noise floor."""
        return self.budget.error_aligned / self.noise_floor - 1 if self.noise_floor else None

    @property
    def is_above_floor(self) -> bool:
        """Whether the final aligned error exceeds the noise floor by more than its tolerance."""
        return self.above_floor is not None and self.above_floor > self.settings.at_floor

    @property
    def changes(self) -> tuple[ErrorChange, ...]:
        """Changes of the held-out error, finding by finding, in the order in which they were added."""
        steps = self.budget.aligned_steps
        rows = zip(self._names, pairwise(steps), strict=False)
        changes = [_change(name, before, after, self.settings) for name, (before, after) in rows]
        return tuple(replace(change, is_needed=change.name in self.needed) for change in changes)

    @property
    def _names(self) -> list[str]:
        """Names of all findings in the order of the steps of the budget."""
        position: dict[int, int] = {}
        for row, step in enumerate(self.budget.steps):
            position.setdefault(id(step), row)
        placed = {
            position[id(one.error_before)]: one.effect for one in self.effects if id(one.error_before) in position
        }
        others = iter(
            [finding.effect for finding in self.effects if finding.effect not in placed.values()]
            + [unknown.name for unknown in self.unknowns]
        )
        count = len(self.effects) + len(self.unknowns)
        return [placed[row] if row in placed else next(others, "") for row in range(count)]

    def to_json(self) -> dict[str, Any]:
        """Contents of the file of `cosim diagnose --json`."""
        words = Vocabulary([type(effect) for effect in self.sensor.effects])
        return {
            "verdict": self.verdict,
            "labels": self.labels.to_json() if self.labels else None,
            "effects": [finding.to_json(words) for finding in self.effects],
            "ranking": [one.to_json() for one in self.ranking],
            "unknown": self.unknown.to_json() if self.unknown else None,
            "unknowns": [one.to_json() for one in self.unknowns],
            "unexplained": [one.to_json() for one in self.unexplained],
            "either_or": [list(names) for names in self.either_or],
            "evidence": [cell.to_json() for cell in self.evidence],
            "smallest_detectable": {
                effect: {name: value if words.is_possible(effect, name, value) else None for name, value in row.items()}
                for effect, row in self.smallest_detectable.items()
            },
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
        """Write the improved sensor to a file, and unknown effects as plug-ins next to it; returns the path.

        Raises:
            OutputError: the folder cannot be written.
        """
        from cosim.discrepancy.unknown.source import effect_source
        from cosim.drives.sensor_files import write_sensor

        own = {one.name: (one.class_name, effect_source(one)) for one in self.unknowns}
        return write_sensor(self.sensor, Path(path), own)

    def __str__(self) -> str:
        return headline(self, Vocabulary([type(effect) for effect in self.sensor.effects]))


def headline(diagnosis: Diagnosis, words: Vocabulary) -> str:
    """The summary line of `cosim diagnose`."""
    no_fall = {change.name for change in diagnosis.changes if not change.is_fall}
    parts = [_finding_words(finding, words, finding.effect in no_fall) for finding in diagnosis.effects]
    if parts:
        ambiguous = any(finding.also_possible for finding in diagnosis.effects)
        parts[0] = f"{'ambiguous' if ambiguous else 'missing'}: {parts[0]}"
    for unknown in diagnosis.unknowns:
        p_value = p_words(unknown.curve.p_value)
        parts.append(f"unknown: {unknown_words(unknown)}, {p_value}{NO_FALL if unknown.name in no_fall else ''}")
    if diagnosis.labels is not None and diagnosis.labels.verdict == "missing":
        parts.append(str(diagnosis.labels))
    if diagnosis.unexplained:
        parts.append(f"unexplained: {listed([unexplained_words(row) for row in diagnosis.unexplained[:FEW]])}")
    if not parts and diagnosis.is_above_floor:
        parts.append("unexplained: the error is above the noise floor, and no hypothesis is significant")
    if not parts:
        smallest = smallest_words(diagnosis, words, most=3)
        parts.append(f"nothing missing: no significant effect{f'; detectable: {smallest}' if smallest else ''}")
    return f"{'; '.join(parts)}; {budget_words(diagnosis, is_complete=diagnosis.verdict == 'none')}"


NO_FALL = " (does not lower the error)"


def budget_words(diagnosis: Diagnosis, *, is_complete: bool) -> str:
    """The sources of the error: `held-out error 1.32, 4.3 × the noise floor, of which poses 3.1; aligned 0.31, …`.

    Args:
        diagnosis: diagnosis to show.
        is_complete: whether nothing is missing.
    """
    budget, line = diagnosis.budget, f"{error_words(diagnosis)} {diagnosis.error_before:.3f}"
    if not budget.floor:
        fall = _fall(diagnosis.error_before, diagnosis.error_after)
        return f"{error_words(diagnosis)} {fall}; the noise floor cannot be determined"
    sources = source_words(budget.parts, budget.floor, is_complete=is_complete)
    aligned = _fall(budget.given_aligned, budget.error_aligned)
    line += f", {times(budget.error / budget.floor)} the noise floor{sources and f', of which {sources}'}"
    if diagnosis.effects or diagnosis.unknowns:
        line += f"; {diagnosis.error_after:.3f} with all findings"
    return f"{line}; aligned {aligned}, {floor_words(diagnosis)}"


def _fall(before: float, after: float) -> str:
    """An error before and after the findings."""
    same = round(before, 3) == round(after, 3)
    return f"{before:.3f}" if same else f"{before:.3f} → {after:.3f}"


def floor_words(diagnosis: Diagnosis) -> str:
    """The final aligned error relative to the noise floor; empty without a noise floor."""
    above = diagnosis.above_floor
    if above is None:
        return ""
    return f"{times(1 + above)} the noise floor" if diagnosis.is_above_floor else "at the noise floor"


def error_words(diagnosis: Diagnosis) -> str:
    """Name of the error of a diagnosis."""
    return "held-out error" if diagnosis.split.is_held_out else "error on the fitted frames"


def smallest_words(diagnosis: Diagnosis, words: Vocabulary, most: int) -> str:
    """The smallest detectable amplitudes of a few effects, those of common effects first."""
    rows = [row for row in smallest_rows(diagnosis) if words.is_possible(*row)]
    rows.sort(key=lambda row: _PLAIN.index(row[0]) if row[0] in _PLAIN else len(_PLAIN))
    return ", ".join(f"{effect} from {words.quantity(effect, name, value)}" for effect, name, value in rows[:most])


def smallest_rows(diagnosis: Diagnosis) -> list[tuple[str, str, float]]:
    """Effect, amplitude and smallest detectable value, where it is above 0."""
    return [
        (effect, name, value)
        for effect, values in sorted(diagnosis.smallest_detectable.items())
        for name, value in values.items()
        if np.isfinite(value) and value > 0
    ]


def _finding_words(finding: Finding, words: Vocabulary, is_useless: bool) -> str:
    values = words.parameters(finding.effect, finding.params, finding.ci95)
    similar = f"; cannot be distinguished from {listed(list(finding.also_possible))}" if finding.also_possible else ""
    return f"{finding.effect} ({values}), {p_words(finding.p_value)}{NO_FALL if is_useless else ''}{similar}"


def _change(name: str, before: HeldOut, after: HeldOut, settings: Settings) -> ErrorChange:
    """The change between two steps; its interval is Student's, over frames."""
    by_frame = after.by_frame - before.by_frame
    by_frame = by_frame[np.isfinite(by_frame)]
    if len(by_frame) < 2:
        return ErrorChange(name, before.error, after.error, float("nan"), float("nan"))
    half = stats.t.ppf(settings.upper, len(by_frame) - 1) * np.std(by_frame, ddof=1) / np.sqrt(len(by_frame))
    return ErrorChange(name, before.error, after.error, float(by_frame.mean()), float(half))
