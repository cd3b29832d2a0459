"""One round of a calibration: a map of points corrected by the sensor file, and the effects missing from the file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.discrepancy.candidates import amplitudes
from cosim.discrepancy.diagnosis import Diagnosis
from cosim.drives.files import read_text
from cosim.drives.writer import explained
from cosim.errors import FormatError
from cosim.recordings.mapping.correction import moves_points
from sensors.effects.base import Effect
from sensors.effects.registry import effect_classes

FILE = "round.json"
_STILL = 0.25  # of an interval's width: a parameter that moves by less has not moved
_TAKEN_UP = 0.2  # of what an effect still does to the points of a map, at most; 0.02 to 0.17 in simulated recordings


@dataclass(frozen=True)
class Judgement:
    """Results of a round in addition to its diagnosis.

    Attributes:
        transfers: what each finding does to held-out scans, see `acceptance.Transfer`.
        accepted: file with the findings that lower the error of held-out scans, or that move points.
        limits: what the path of the sensor does not vary, as predicates of the drive.
        sweep_scale: share of the motion in a sweep that points are freed of where no effect says it.
        directions: angles between the beams that two halves give, see `DirectionError`; of the last round only.
        advice: what to record next, see `Advice`; of the last round only.
        cpu_s: processor time of the round.
    """

    transfers: list[dict[str, Any]]
    accepted: str
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
    diagnosis: Diagnosis,
    made: Mapping[str, Any],
    judgement: Judgement,
) -> Round:
    """A round in words and numbers.

    Args:
        number: from 1.
        sensor, sensor_out: files, relative to the calibration's folder.
        before: effects of the sensor that it began with.
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
        moved=is_moved(diagnosis, before),
        **vars(judgement),
        notes=list(dict.fromkeys((*made["notes"], *diagnosis.notes))),
    )


def is_moved(diagnosis: Diagnosis, before: Sequence[Effect]) -> bool:
    """Whether what was found, or fitted again, moves points of the map."""
    rows = [*diagnosis.to_json()["effects"], *({"effect": name, **one} for name, one in diagnosis.refitted.items())]
    return any(_moves(one, before) for one in rows)


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
        left = _TAKEN_UP * (value - np.resize(undone[amplitude], value.shape))
        wider[amplitude] = np.stack(
            [pair[..., 0] + np.minimum(left, 0), pair[..., 1] + np.maximum(left, 0)], -1
        ).tolist()
    return wider


def _moves(finding: Mapping[str, Any], before: Sequence[Effect]) -> bool:
    """Whether a finding changes where points of the map come to lie."""
    if not moves_points(finding["effect"]):
        return False
    known = next((one.model_dump(mode="json") for one in before if one.name == finding["effect"]), None)
    if known is None:
        return True
    for name, value in finding["params"].items():
        interval = finding["ci95"].get(name)
        if isinstance(value, list) or interval is None:
            return True
        if abs(value - known[name]) > _STILL * (interval[1] - interval[0]):
            return True
    return False
