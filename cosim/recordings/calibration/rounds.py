"""One round of a calibration: a map of points corrected by the sensor file, and the effects missing from the file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.discrepancy.candidates import amplitudes, is_unchanged
from cosim.discrepancy.diagnosis import Diagnosis
from cosim.drives.files import read_text
from cosim.drives.writer import explained
from cosim.errors import FormatError
from cosim.recordings.mapping.correction import moves_points
from sensors.effects.base import Effect
from sensors.effects.registry import effect_classes

FILE = "round.json"
_STILL = 0.5  # of an interval's width: a parameter that moves by less stays in its interval
_TAKEN_UP = 0.2  # of what an effect still does to the points of a map, at most; 0.02 to 0.17 in simulated recordings


@dataclass(frozen=True)
class Judgement:
    """Results of a round in addition to its diagnosis.

    Attributes:
        transfers: what each finding does to held-out scans, see `acceptance.Transfer`.
        accepted: file with the findings that lower the error of held-out scans, or that move points.
        dropped: effects that earlier rounds found, and whose intervals now include no change.
        limits: what the path of the sensor does not vary, as predicates of the drive.
        sweep_scale: share of the motion in a sweep that points are freed of where no effect says it.
        directions: angles between the beams that two halves give, see `DirectionError`; of the last round only.
        advice: what to record next, see `Advice`; of the last round only.
        cpu_s: processor time of the round.
    """

    transfers: list[dict[str, Any]]
    accepted: str
    dropped: list[str]
    limits: list[str]
    sweep_scale: float
    directions: dict[str, Any] | None
    advice: list[dict[str, Any]]
    cpu_s: float


@dataclass(frozen=True)
class Round(Judgement):
    """Result of one round; paths are relative to the calibration's folder.

    Attributes:
        number: from 1.
        sensor: file that the round began with.
        sensor_out: file that it ended with.
        effects: of the sensor at its beginning, with parameters.
        findings: what was missing, as `diagnose --json` lists effects.
        refitted: of effects that earlier rounds found, by name their `params` and `ci95` now.
        unknowns, unexplained: as there.
        not_told: smallest amplitude of each effect that would have been found.
        error, error_aligned, noise_floor: of the sensor it began with, on scans that took no part.
        error_after, aligned_after: of the one it ended with.
        budget: what the error is made of.
        thickness_ground_m, thickness_walls_m: of the map.
        held_out_m: spread of held-out scans across the map.
        moved: whether a finding moves points, so that a new map is needed.
        notes: a sentence each.
    """

    number: int
    sensor: str
    sensor_out: str
    effects: list[dict[str, Any]]
    findings: list[dict[str, Any]]
    refitted: dict[str, dict[str, Any]]
    unknowns: list[dict[str, Any]]
    unexplained: list[dict[str, Any]]
    not_told: dict[str, Any]
    error: float
    error_aligned: float
    noise_floor: float | None
    error_after: float
    aligned_after: float
    budget: dict[str, float]
    thickness_ground_m: float
    thickness_walls_m: float
    held_out_m: float | None
    moved: bool
    notes: list[str]

    def write(self, folder: Path) -> None:
        """Keep it, whole or not at all."""
        with explained(folder):
            new = folder / f"{FILE}.new"
            new.write_text(json.dumps(asdict(self), indent=2) + "\n", encoding="utf-8")
            new.replace(folder / FILE)


def read_round(folder: Path) -> Round | None:
    """A round that was finished; None where it was not.

    Raises:
        FormatError: its file is damaged.
    """
    file = folder / FILE
    if not file.is_file():
        return None
    try:
        return Round(**json.loads(read_text(file)))
    except (ValueError, TypeError) as error:
        raise FormatError(f"{file}: {error}; remove {folder} to have the round done again") from None


def round_of(
    number: int,
    sensor: str,
    sensor_out: str,
    before: Sequence[Effect],
    moved: bool,
    diagnosis: Diagnosis,
    made: Mapping[str, Any],
    judgement: Judgement,
) -> Round:
    """A round in words and numbers.

    Args:
        number: from 1.
        sensor, sensor_out: files, relative to the calibration's folder.
        before: effects of the sensor that it began with.
        moved: see `is_moved`.
        diagnosis: the diagnosis.
        made: `RecordingTwin.as_json` of its map.
        judgement: of its findings.
    """
    report = diagnosis.to_json()
    return Round(
        number=number,
        sensor=sensor,
        sensor_out=sensor_out,
        effects=[{"effect": one.name, **one.model_dump(mode="json")} for one in before],
        findings=[{**one, "ci95": widened(one["effect"], one, before)} for one in report["effects"]],
        refitted={name: {**one, "ci95": widened(name, one, before)} for name, one in diagnosis.refitted.items()},
        unknowns=report["unknowns"],
        unexplained=report["unexplained"],
        not_told=report["smallest_detectable"],
        error=report["error_before"],
        error_aligned=diagnosis.budget.given_aligned,
        noise_floor=diagnosis.noise_floor,
        error_after=report["error_after"],
        aligned_after=diagnosis.budget.error_aligned,
        budget=report["budget"],
        thickness_ground_m=made["thickness_ground_m"],
        thickness_walls_m=made["thickness_walls_m"],
        held_out_m=made["error_held_out_m"],
        moved=moved,
        **vars(judgement),
        notes=list(dict.fromkeys((*made["notes"], *diagnosis.notes))),
    )


def result_of(rounds: Sequence[Round], number: int) -> list[dict[str, Any]]:
    """Effects that the calibrated sensor has in addition, as a round found them, or fitted them again.

    Rows as `diagnose --json` lists effects, and `round`: the number of the round that found them first.

    Args:
        rounds: in order.
        number: of the round, from 1.
    """
    chosen, found = rounds[number - 1], dict[str, dict[str, Any]]()
    for one in rounds[: number - 1]:
        for finding in one.findings:
            found.setdefault(finding["effect"], {**finding, "round": one.number})
    kept = [
        {**found[name], **values}
        for name, values in chosen.refitted.items()
        if name in found and name not in chosen.dropped
    ]
    return [*kept, *({**finding, "round": number} for finding in chosen.findings)]


def fitted_effects(diagnosis: Diagnosis) -> dict[str, Mapping[str, Any]]:
    """`params` and `ci95` of each effect that a diagnosis found, or fitted again."""
    found = {one.effect: {"params": one.params, "ci95": one.ci95} for one in diagnosis.effects}
    return {**found, **diagnosis.refitted}


def dropped_effects(refitted: Mapping[str, Mapping[str, Any]], given: Sequence[Effect]) -> list[str]:
    """Effects that move points, were fitted again, and whose intervals include no change from the given ones.

    Args:
        refitted: `params` and `ci95` by effect.
        given: effects of the sensor that the calibration began with.
    """
    moving = [name for name in refitted if moves_points(name)]
    kinds = {name: effect_classes()[name] for name in moving}
    return [
        name
        for name in moving
        if is_unchanged(kinds[name], refitted[name]["ci95"], _values(kinds[name], given, refitted[name]["params"]))
    ]


def effects_of_next_map(final: Sequence[Effect], given: Sequence[Effect], dropped: Sequence[str]) -> tuple[Effect, ...]:
    """The given effects, and those found that move points: everything else is looked for again on the next map.

    Args:
        final: effects of the sensor at the end of a round.
        given: effects of the sensor that the calibration began with.
        dropped: see `dropped_effects`.
    """
    latest = {one.name: one for one in final if moves_points(one.name) and one.name not in dropped}
    names = {one.name for one in given}
    return (*(latest.get(one.name, one) for one in given), *(latest[name] for name in latest if name not in names))


def is_moved(fitted: Mapping[str, Mapping[str, Any]], before: Sequence[Effect], after: Sequence[Effect]) -> bool:
    """Whether points of the map move by the effects that the next map is made with, instead of those of this one.

    Args:
        fitted: `params` and `ci95` of each effect that was found or fitted again.
        before, after: effects of this map and of the next one.
    """
    return any(moves_points(name) and _changes(name, values, before, after) for name, values in fitted.items())


def widened(name: str, values: Mapping[str, Any], before: Sequence[Effect]) -> dict[str, Any]:
    """Intervals that allow for the part of an effect that the map absorbs, so that estimates are too small.

    Points were freed of the effect as far as it was known, of nothing at first. So amplitudes may lie farther beyond
    their values, by a share of what was not known yet.

    Args:
        name: of the effect.
        values: `params` and `ci95` of the finding.
        before: effects of the sensor that the map was made with.
    """
    wider = dict(values["ci95"])
    if not moves_points(name):
        return wider
    kind = effect_classes()[name]
    undone = next((vars(one) for one in before if one.name == name), kind.neutral or {})
    for amplitude in wider.keys() & set(amplitudes(kind)):
        value, pair = np.asarray(values["params"][amplitude], float), np.asarray(wider[amplitude], float)
        left = np.nan_to_num(_TAKEN_UP * (value - np.resize(undone[amplitude], value.shape)))  # NaN: undetermined
        wider[amplitude] = np.stack(
            [pair[..., 0] + np.minimum(left, 0), pair[..., 1] + np.maximum(left, 0)], -1
        ).tolist()
    return wider


def _changes(name: str, fitted: Mapping[str, Any], before: Sequence[Effect], after: Sequence[Effect]) -> bool:
    """Whether the parameters of an effect change by more than half the width of their intervals."""
    kind = effect_classes()[name]
    known, new = (_values(kind, effects, fitted["params"]) for effects in (before, after))
    if known is None or new is None:
        return known is not new
    for parameter in fitted["params"]:
        interval = fitted["ci95"].get(parameter)
        change = np.ravel(np.subtract(new[parameter], known[parameter]))
        if interval is None:
            if np.any(change):
                return True
            continue
        width = np.ptp(np.reshape(interval, (-1, 2)), axis=1)
        if float(np.sqrt(np.mean((change / np.maximum(width, 1e-12)) ** 2))) > _STILL:
            return True
    return False


def _values(kind: type[Effect], effects: Sequence[Effect], like: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Parameters of an effect; where it is not among the effects the neutral ones, if it has any.

    Args:
        kind: of the effect.
        effects: of a sensor.
        like: parameters whose lists have one value for each laser of the sensor.
    """
    own = next((one.model_dump() for one in effects if one.name == kind.name), None)
    if own is not None or kind.neutral is None:
        return own
    return {name: np.resize(value, np.shape(like[name])) for name, value in kind.neutral.items()}
