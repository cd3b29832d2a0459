"""`cosim diagnose`: identify the physical effects that a sensor model is missing, from measurements."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.options import (
    add_common,
    add_detector,
    add_frames,
    add_lidar,
    beside,
    chosen_detector,
    chosen_lidar,
    say_notes,
    without_nan,
    write_json,
)
from cosim.cli.progress import ProgressReport
from cosim.drives.writer import explained

if TYPE_CHECKING:
    from cosim.discrepancy.diagnosis import Diagnosis
    from cosim.drives.kitti import Drive
    from cosim.variants.worth import Worth
    from sensors.effects.base import Effect
    from sensors.sensor_model import SensorModel


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "diagnose", help="identify the effects that a sensor model is missing", description=__doc__
    )
    parser.add_argument("drive", type=Path, metavar="DRIVE", help="folder of a measured drive with a twin")
    parser.add_argument(
        "--sensor", required=True, metavar="FILE|NAME", help="sensor file, or the name of a built-in sensor or pattern"
    )
    parser.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="PATH.py:CLASS",
        help="user-defined effect to test in addition to the catalogue; may be repeated",
    )
    add_lidar(parser)
    add_frames(parser)
    add_detector(parser, "each effect that was missing")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the report page (default: DRIVE-diagnosis)")
    parser.add_argument(
        "--sensor-out",
        type=Path,
        metavar="FILE",
        help="file of the improved sensor (default: sensor.yaml in the folder of the page)",
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Diagnose the sensor model, then write the improved sensor and the page."""
    from cosim.cli.frame_choice import chosen_frames
    from cosim.discrepancy import diagnose
    from cosim.discrepancy.data.checks import opened
    from cosim.discrepancy.diagnosis import headline
    from cosim.discrepancy.report import format_diagnosis
    from cosim.discrepancy.words import Vocabulary
    from cosim.report import write_page
    from sensors.sensor_model import load_sensor

    path = chosen_lidar(options.drive, options)
    sensor, drive, detector = load_sensor(options.sensor), opened(path), chosen_detector(options)
    extra = [_find_testable_effect(text) for text in options.effect]
    names = tuple(sorted(chosen_frames(drive, options.frames))) if options.frames else None
    folder = options.out or beside(path, "diagnosis")
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with ProgressReport(console, "reading the drive") as report:
        result = diagnose(drive, sensor, frames=names, extra=extra, on_progress=report.say)
        if detector is not None:
            worth = _measure_detector(result, drive, names or drive.frames, sensor, detector, report)
            result = replace(result, worth=worth)
    sensor_out = result.write_sensor(options.sensor_out or folder / "sensor.yaml")
    result = replace(result, sensor_out=os.path.relpath(sensor_out))
    words = Vocabulary(extra)
    page = write_page(folder, format_diagnosis(result, words, str(path), str(options.sensor)))
    if not options.quiet:
        print(headline(result, words))
    say_notes(result.notes, console)
    console.print(f"{page}; the improved sensor: {result.sensor_out}", soft_wrap=True, highlight=False)
    write_json(options.json, without_nan(result.to_json()))


def _measure_detector(
    diagnosis: Diagnosis,
    drive: Drive,
    names: Sequence[str],
    baseline: SensorModel,
    detector: Path,
    report: ProgressReport,
) -> Worth:
    """Measure how a detector's average precision changes without each missing effect, including unknown effects."""
    from training.worth import value_effects

    report.begin("measuring without each effect", len(names))
    missing = [finding.effect for finding in diagnosis.effects] + [unknown.name for unknown in diagnosis.unknowns]
    present = {effect.name for effect in diagnosis.sensor.effects}
    return value_effects(
        drive,
        names,
        diagnosis.sensor,
        [name for name in missing if name in present],
        detector,
        given=baseline,
        on_frame=report.advance,
    )


def _find_testable_effect(text: str) -> type[Effect]:
    from sensors.effects.registry import find_effect
    from sensors.errors import SensorError

    effect = find_effect(text)
    if effect.neutral is None or effect.stage == "label":
        raise SensorError(
            f"effect {text}: cannot be tested; define `neutral` (parameters without an effect) in the class, and "
            "derive it from another stage than label"
        )
    return effect
