"""Calibration loop: pattern, map, diagnosis; then again with corrected points, until nothing changes."""

from __future__ import annotations

import hashlib
import json
import logging
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from cosim.discrepancy.diagnose import diagnose
from cosim.discrepancy.diagnosis import Diagnosis
from cosim.discrepancy.report import explored_of, format_diagnosis
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.discrepancy.words import Vocabulary
from cosim.drives.files import read_text
from cosim.drives.sensor_files import write_sensor
from cosim.drives.writer import OutputError, explained
from cosim.engine import Engine
from cosim.recordings.calibration.acceptance import (
    SCORES,
    Acceptance,
    Transfer,
    accept,
    path_limits,
    step_transfers,
)
from cosim.recordings.calibration.advice import advise, undetermined
from cosim.recordings.calibration.corrected import RESULT
from cosim.recordings.calibration.halves import direction_error_of_halves
from cosim.recordings.calibration.held_out import aligned_scores, write_scores
from cosim.recordings.calibration.history import Tried, noted
from cosim.recordings.calibration.rounds import (
    Judgement,
    Round,
    dropped_effects,
    effects_of_next_map,
    fitted_effects,
    is_moved,
    read_round,
    result_of,
    round_of,
)
from cosim.recordings.calibration.start import GUESSED, first_sensor
from cosim.recordings.mapping.correction import moves_points
from cosim.recordings.mapping.page import format_page as format_map
from cosim.recordings.mapping.prepare import Prepared, prepare
from cosim.recordings.mapping.twin import RecordingTwin, write_map_twin
from cosim.recordings.recording import Recording
from cosim.report import write_page
from sensors.effects.base import BeamEffect, Effect, NoiseEffect
from sensors.effects.registry import effect_classes
from sensors.pattern import Pattern
from sensors.sensor_model import SensorModel, load_sensor

_LOG = logging.getLogger(__name__)
MOST_ROUNDS = 5
_HEAD, _SEGMENTS = "calibration.json", "segments"
_NEXT = "next_map.yaml"  # sensor file that the map of the next round is made with
_OWN = "found"
LASERS = "lasers.json"  # what the points show of the pattern, see `FoundPattern.as_json`


@dataclass(frozen=True, eq=False)
class SensorCalibration:
    """Result of a calibration.

    Attributes:
        folder: of everything.
        recording: its path.
        start: the sensor file that it began with, relative to the folder.
        rounds: in order.
        settled: whether the last round moved nothing any more.
        tried: every sensor file that was tried on this recording so far.
        acceptance: whether the calibrated file is recommended.
    """

    folder: Path
    recording: Path
    start: str
    rounds: tuple[Round, ...]
    settled: bool
    tried: tuple[Tried, ...]
    acceptance: Acceptance

    @property
    def result(self) -> Round:
        """The round whose result counts: the recommended one, otherwise the last."""
        return self.rounds[(self.acceptance.round or len(self.rounds)) - 1]

    @property
    def effects(self) -> list[dict[str, Any]]:
        """Effects that were missing, see `result_of`."""
        return result_of(self.rounds, self.result.number)

    @property
    def sensor_out(self) -> Path:
        """The sensor file to use: the accepted one of a round, or the one that the calibration began with."""
        chosen = self.acceptance.round
        return self.folder / (self.rounds[chosen - 1].accepted if chosen else self.start)

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "out": str(self.folder),
            "sensor_out": str(self.sensor_out),
            "recommended": self.acceptance.is_recommended,
            "acceptance": self.acceptance.as_json(),
            "settled": self.settled,
            "effects": self.effects,
            "rounds": [asdict(one) for one in self.rounds],
            "history": [asdict(one) for one in self.tried],
            "notes": self.rounds[-1].notes,
        }


def calibrate(
    recording: Recording,
    folder: Path,
    sensor: str | Path | None = None,
    *,
    pattern: Pattern | None = None,
    settings: Settings = DEFAULT,
    most_rounds: int = MOST_ROUNDS,
    engine: Engine | None = None,
    on_step: Callable[[str], None] = _LOG.debug,
) -> SensorCalibration:
    """Find the effects that a sensor model is missing on a recording; rounds finished by an earlier run are kept.

    Args:
        recording: scans in order.
        folder: to write.
        sensor: file of the initial model; by default the pattern and noise estimated from the points.
        pattern: of the beams, where no sensor is given; by default that which the points show.
        settings: numbers that decide a diagnosis.
        most_rounds: of map and diagnosis.
        engine: whose processes share the segments of a long recording; by default this process does all.
        on_step: called with a description of each step before it starts.

    Raises:
        RecordingError: no pattern or no map in the scans, or another pattern than the sensor's.
        OutputError: the folder cannot be written, or is another recording's.
        SensorError: no such sensor file.
    """
    _claimed(folder, recording)
    given = None if sensor is None else load_sensor(sensor)
    own = folder / f"from_{_OWN if sensor is None else Path(sensor).stem}"
    pattern = pattern if given is None else given.pattern
    prepared = cache(lambda: prepare(recording, own / _SEGMENTS, pattern, engine=engine, on_step=on_step))
    start = own / "sensor.yaml"
    if given is not None and start.is_file() and load_sensor(start).effects != given.effects:
        raise OutputError(f"{own} began with another sensor file of that name; rename {sensor}, or remove the folder")
    if not start.is_file():
        write_sensor(first_sensor(prepared()) if given is None else given, start)
        lasers = json.dumps(prepared().found.as_json(), indent=2)
        (own / LASERS).write_text(lasers + "\n", encoding="utf-8")
    rounds: list[Round] = []
    for number in range(1, most_rounds + 1):
        path = own / f"round_{number}"
        done = read_round(path)
        if done is None:
            on_step(f"round {number}")
            before = own / f"round_{number - 1}" / _NEXT if rounds else start
            known = {finding["effect"] for one in rounds for finding in one.findings}
            along = [*(GUESSED if given is None else ()), *sorted(name for name in known if moves_points(name))]
            last = number == most_rounds
            done = _round(prepared(), folder, path, start, before, along, number, last, settings, engine, on_step)
        rounds.append(done)
        if not done.moved:
            break
    tried = noted(folder, rounds)
    acceptance = accept(folder, rounds)
    calibration = SensorCalibration(
        folder, recording.path, _said(start, folder), tuple(rounds), not rounds[-1].moved, tried, acceptance
    )
    _write_result(calibration)
    return calibration


def _round(
    prepared: Prepared,
    folder: Path,
    round_folder: Path,
    start: Path,
    before: Path,
    along: Sequence[str],
    number: int,
    last: bool,
    settings: Settings,
    engine: Engine | None,
    on_step: Callable[[str], None],
) -> Round:
    """Map and diagnosis with one sensor file; effects that earlier rounds found, and guesses, are fitted along.

    The next map is made with the effects of `start` and those found that move points. All others are looked for again,
    because they may be errors of this map.
    """
    begun_s = time.process_time()
    shutil.rmtree(round_folder / "twin", ignore_errors=True)  # of a run that was stopped
    sensor = load_sensor(before)
    twin = write_map_twin(
        prepared,
        round_folder / "twin",
        round_folder / _SEGMENTS,
        sensor.effects,
        sampled=True,
        engine=engine,
        on_step=on_step,
    )
    write_page(round_folder / "map", format_map(twin))
    found = diagnose(round_folder / "twin", sensor, settings=settings, refitted=along, on_progress=on_step)
    after = found.write_sensor(round_folder / "sensor.yaml")
    words = Vocabulary([type(one) for one in found.sensor.effects])
    page = format_diagnosis(found, words, str(round_folder / "twin"), str(before), explored_of(found))
    write_page(round_folder / "diagnosis", page)
    given = load_sensor(start).effects
    dropped = dropped_effects(found.refitted, given)
    next_effects = effects_of_next_map(found.sensor.effects, given, dropped)
    write_sensor(SensorModel(sensor.pattern, next_effects, sensor.origin), round_folder / _NEXT)
    moved = is_moved(fitted_effects(found), sensor.effects, next_effects)
    is_last = last or not moved
    transfers = step_transfers(found)
    judgement = Judgement(
        transfers=[asdict(one) for one in transfers],
        accepted=_said(_write_accepted(found, sensor.effects, given, dropped, transfers, round_folder), folder),
        dropped=dropped,
        limits=path_limits(prepared.path),
        sweep_scale=prepared.sweep_scale,
        directions=_directions(prepared, twin.folder, found, settings, on_step) if is_last else None,
        advice=_advice(prepared, twin, found) if is_last else [],
        cpu_s=round(time.process_time() - begun_s, 1),
    )
    finished = round_of(
        number, _said(before, folder), _said(after, folder), sensor.effects, moved, found, twin.as_json(), judgement
    )
    finished.write(round_folder)
    for copies in (twin.folder / "velodyne", twin.folder / "rays", round_folder / _SEGMENTS):  # of what is elsewhere
        shutil.rmtree(copies, ignore_errors=True)
    return finished


def _directions(
    prepared: Prepared, twin: Path, diagnosis: Diagnosis, settings: Settings, on_step: Callable[[str], None]
) -> dict[str, Any] | None:
    """Angles between the beams that two halves of the recording give."""
    on_step("beam directions from two halves")
    free = [one.effect for one in diagnosis.effects if issubclass(effect_classes()[one.effect], BeamEffect)]
    free += [name for name in diagnosis.refitted if issubclass(effect_classes()[name], BeamEffect) and name not in free]
    error = direction_error_of_halves(prepared.recording, twin, diagnosis.sensor, diagnosis.split.fit, free, settings)
    return None if error is None else error.as_json()


def _advice(prepared: Prepared, twin: RecordingTwin, diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Advice on the next recording."""
    report = diagnosis.to_json()
    fitted = {one["effect"]: one for one in report["effects"]} | dict(diagnosis.refitted)
    systematic = {name: one for name, one in fitted.items() if not issubclass(effect_classes()[name], NoiseEffect)}
    rows = undetermined(report["smallest_detectable"], systematic)
    height_m = twin.as_json()["mount"]["height_m"]
    advice = advise(rows, prepared.path.poses, height_m, prepared.pattern, diagnosis.sensor.effects)
    return [one.as_json() for one in advice]


def _write_accepted(
    diagnosis: Diagnosis,
    before: Sequence[Effect],
    given: Sequence[Effect],
    dropped: Sequence[str],
    transfers: Sequence[Transfer],
    folder: Path,
) -> Path:
    """Write the sensor without the findings that do not lower the error of held-out scans, and scores of both models.

    Args:
        diagnosis: the diagnosis.
        before: effects of the sensor as given: a finding that changes one of these and is rejected leaves it as it was.
        given: effects of the sensor that the calibration began with.
        dropped: effects of earlier rounds that are taken back.
        transfers: of the findings.
        folder: folder of the round.
    """
    rejected = {*dropped, *(one.effect for one in transfers if not one.is_accepted)}
    pairs, sensor = diagnosis.frame_pairs, diagnosis.sensor
    assert pairs is not None, "a diagnosis keeps its pairs of frames"
    accepted = pairs.after
    if rejected:
        known = {effect.name: effect for effect in before if effect.name not in dropped}
        known |= {effect.name: effect for effect in given if effect.name in dropped}
        own = [known.get(one.name) if one.name in rejected else one for one in sensor.effects]
        effects = tuple(one for one in own if one is not None)
        sensor = SensorModel(sensor.pattern, effects, sensor.origin)
        accepted = pairs.align(effects)
    unknowns = tuple(one for one in diagnosis.unknowns if one.name not in rejected)
    file = replace(diagnosis, sensor=sensor, unknowns=unknowns).write_sensor(folder / "accepted.yaml")
    write_scores(folder / SCORES, {"given": aligned_scores(pairs.before), "accepted": aligned_scores(accepted)})
    return file


def _write_result(calibration: SensorCalibration) -> None:
    """Keep what exports need."""
    chosen = calibration.result
    poses = (calibration.folder / chosen.sensor_out).parent / "twin/twin/poses.npz"
    report = {
        "recording": str(calibration.recording.resolve()),
        "sensor_file": _said(calibration.sensor_out, calibration.folder),
        "recommended": calibration.acceptance.is_recommended,
        "poses_file": _said(poses, calibration.folder),
        "sweep_scale": chosen.sweep_scale,
    }
    with explained(calibration.folder):
        (calibration.folder / RESULT).write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


def _said(file: Path, folder: Path) -> str:
    return file.resolve().relative_to(folder.resolve()).as_posix()


def _claimed(folder: Path, recording: Recording) -> None:
    """Say whose calibration the folder is.

    Raises:
        OutputError: it is another recording's, or the recording itself.
    """
    if folder.resolve() == recording.path.resolve():
        raise OutputError(f"{folder} is the recording itself; choose another --out")
    names = hashlib.sha256("\n".join(recording.names).encode()).hexdigest()[:16]
    inputs = {"recording": str(recording.path.resolve()), "scans": len(recording), "names": names}
    file = folder / _HEAD
    if file.is_file():
        try:
            theirs = json.loads(read_text(file))
        except ValueError as error:
            raise OutputError(f"{file}: {error}; choose another --out") from None
        if theirs != inputs:
            raise OutputError(f"{folder} holds a calibration on {theirs.get('recording')}; choose another --out")
        return
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(inputs, indent=2) + "\n", encoding="utf-8")
