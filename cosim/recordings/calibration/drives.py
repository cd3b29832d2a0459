"""Several drives of one sensor, or of several units of a type: calibrated each, combined, and compared."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.discrepancy.candidates import with_values
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.drives.sensor_files import write_sensor
from cosim.drives.writer import OutputError, explained
from cosim.engine import Engine
from cosim.recordings.calibration.directions import DirectionError, direction_error
from cosim.recordings.calibration.estimates import Combined, Difference, combine, differences, estimates_of
from cosim.recordings.calibration.loop import LASERS, MOST_ROUNDS, SensorCalibration, calibrate
from cosim.recordings.recording import Recording
from sensors.effects.base import Effect
from sensors.pattern import Pattern
from sensors.sensor_model import SensorModel, load_sensor

SENSOR, RESULT = "sensor.yaml", "drives.json"
_CONE = "pattern"


@dataclass(frozen=True, eq=False)
class Drives:
    """Results of several drives.

    Attributes:
        folder: of everything.
        names: of the drives, in order.
        calibrations: of each.
        combined: every number that a drive estimates.
        differences: every number in every pair of drives, the most significant first.
        directions: angles between the beams of the first drive and of each other.
        is_recommended: whether all drives recommend their calibration.
    """

    folder: Path
    names: tuple[str, ...]
    calibrations: tuple[SensorCalibration, ...]
    combined: tuple[Combined, ...]
    differences: tuple[Difference, ...]
    directions: tuple[DirectionError | None, ...]

    @property
    def is_recommended(self) -> bool:
        """Whether every drive confirms its calibration on held-out scans."""
        return all(one.acceptance.is_recommended for one in self.calibrations)

    @property
    def sensor_out(self) -> Path:
        """The file with the combined parameters where all drives confirm it, else the one that they began with."""
        first = self.calibrations[0]
        return self.folder / SENSOR if self.is_recommended else first.folder / first.start

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "out": str(self.folder),
            "sensor_out": str(self.sensor_out),
            "recommended": self.is_recommended,
            "drives": {name: one.as_json() for name, one in zip(self.names, self.calibrations, strict=True)},
            "combined": [one.as_json() for one in self.combined],
            "differences": [one.as_json() for one in self.differences],
            "directions": [None if one is None else one.as_json() for one in self.directions],
        }


def calibrate_drives(
    recordings: Sequence[Recording],
    folder: Path,
    sensor: str | Path | None = None,
    *,
    settings: Settings = DEFAULT,
    most_rounds: int = MOST_ROUNDS,
    is_one_sensor: bool = True,
    engine: Engine | None = None,
    on_step: Callable[[str], None] = lambda words: None,
) -> Drives:
    """Calibrate each drive, beginning with the same file, and combine and compare what they give.

    Args:
        recordings: drives of one sensor, or of several units of a type.
        folder: to write; each drive has a folder of its own in it.
        sensor: file of the initial model; by default the pattern estimated from the first drive.
        is_one_sensor: whether all drives have the beams of the first; otherwise each shows its own.
        settings, most_rounds, engine, on_step: as of `calibrate`.

    Raises:
        RecordingError: as of `calibrate`.
        OutputError: as of `calibrate`, or two drives have the same name.
    """
    names = tuple(one.path.resolve().name for one in recordings)
    if len(set(names)) < len(names):
        raise OutputError(f"two drives are called {max(names, key=names.count)}; rename one of the folders")
    found = list[SensorCalibration]()
    for name, recording in zip(names, recordings, strict=True):

        def step(words: str, name: str = name) -> None:
            on_step(f"{name}: {words}")

        beams = load_sensor(found[0].folder / found[0].start).pattern if found and is_one_sensor else None
        found.append(
            calibrate(
                recording,
                folder / name,
                sensor,
                pattern=beams,
                settings=settings,
                most_rounds=most_rounds,
                engine=engine,
                on_step=step,
            )
        )
    estimates = [{**estimates_of(one.result), **_cones(one)} for one in found]
    models = [load_sensor(one.folder / one.result.sensor_out) for one in found]
    shown = [(_shown(one), model.effects) for one, model in zip(found, models, strict=True)]
    apart = [direction_error(shown[0][0], pattern, shown[0][1], effects) for pattern, effects in shown[1:]]
    combined = combine(estimates)
    result = Drives(folder, names, tuple(found), combined, differences(names, estimates), tuple(apart))
    write_sensor(_combined_sensor(found, models, combined), folder / SENSOR)
    with explained(folder):
        (folder / RESULT).write_text(json.dumps(_plain(result), indent=2) + "\n", encoding="utf-8")
    return result


def _plain(drives: Drives) -> dict[str, Any]:
    report = drives.as_json()
    return {name: report[name] for name in ("recommended", "combined", "differences", "directions")}


def _shown(one: SensorCalibration) -> Pattern:
    """The drive's pattern with the elevations that its own points show, where they show every laser."""
    pattern, cones = load_sensor(one.folder / one.start).pattern, _cones(one)
    shown = cones[_CONE, "elevation_deg"][0] if cones else []
    return pattern.model_copy(update={"elevation_deg": tuple(shown)}) if len(shown) == pattern.rings else pattern


def _cones(one: SensorCalibration) -> dict[tuple[str, str], tuple[Any, Any]]:
    """Elevations that the points of a drive show, with 95 % intervals."""
    file = one.folder / Path(one.start).parent / LASERS
    if not file.is_file():
        return {}
    report = json.loads(file.read_text(encoding="utf-8"))
    value, sd = np.array(report["elevation_deg"]), np.maximum(np.array(report["elevation_sd_deg"]), 1e-4)
    return {(_CONE, "elevation_deg"): (value.tolist(), np.stack([value - 1.96 * sd, value + 1.96 * sd], 1).tolist())}


def _combined_sensor(
    calibrations: Sequence[SensorCalibration], models: Sequence[SensorModel], combined: Sequence[Combined]
) -> SensorModel:
    """The first drive's accepted effects, and those of the others, with the combined parameters."""
    effects: dict[str, Effect] = {}
    for one in calibrations:
        accepted = one.folder / one.result.accepted
        for effect in load_sensor(accepted).effects:
            effects.setdefault(effect.name, effect)
    values: dict[tuple[str, str], dict[int | None, float]] = {}
    for number in combined:
        values.setdefault((number.effect, number.parameter), {})[number.row] = number.mean
    for (name, parameter), rows in values.items():
        if name in effects:
            value = (
                rows[None] if None in rows else [rows[row] for row in sorted(row for row in rows if row is not None)]
            )
            effects[name] = with_values(effects[name], {parameter: value})
    return replace(models[0], effects=tuple(effects.values()))
