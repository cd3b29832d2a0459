"""`cosim diagnose`: which physical effects a sensor model lacks, judged by measurements."""

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
    asked_detector,
    beside,
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
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "diagnose", help="which effects a sensor model lacks", description=__doc__
    )
    parser.add_argument("drive", type=Path, metavar="DRIVE", help="measured points with a twin")
    parser.add_argument("--sensor", required=True, metavar="FILE", help="sensor file, or the name of a built-in one")
    parser.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="PATH.py:CLASS",
        help="an effect of your own to ask for beside the catalogue; may be given more than once",
    )
    add_lidar(parser)
    add_frames(parser)
    add_detector(parser, "each effect that was missing")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the page (default: DRIVE-diagnosis)")
    parser.add_argument(
        "--sensor-out", type=Path, metavar="FILE", help="the improved sensor (default: sensor.yaml beside the page)"
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Diagnose, then write the improved sensor and the page."""
    from cosim.cli.frame_choice import chosen_frames
    from cosim.discrepancy import diagnose
    from cosim.discrepancy.data.checks import opened
    from cosim.discrepancy.diagnosis import headline
    from cosim.discrepancy.report import format_diagnosis
    from cosim.discrepancy.words import Vocabulary
    from cosim.report import write_page
    from sensors.sensor_model import load_sensor

    path = chosen_lidar(options.drive, options)
    sensor, drive, detector = load_sensor(options.sensor), opened(path), asked_detector(options)
    extra = [_asked_for(text) for text in options.effect]
    names = tuple(sorted(chosen_frames(drive, options.frames))) if options.frames else None
    folder = options.out or beside(path, "diagnosis")
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with ProgressReport(console, "reading the drive") as report:
        found = diagnose(drive, sensor, frames=names, extra=extra, on_progress=report.say)
        if detector is not None:
            found = replace(found, worth=_worth(found, drive, names or drive.frames, sensor, detector, report))
    sensor_out = found.write_sensor(options.sensor_out or folder / "sensor.yaml")
    found = replace(found, sensor_out=os.path.relpath(sensor_out))
    words = Vocabulary(extra)
    page = write_page(folder, format_diagnosis(found, words, str(path), str(options.sensor)))
    if not options.quiet:
        print(headline(found, words))
    say_notes(found.notes, console)
    console.print(f"{page}; the improved sensor: {found.sensor_out}", soft_wrap=True, highlight=False)
    write_json(options.json, without_nan(found.to_json()))


def _worth(
    found: Diagnosis,
    drive: Drive,
    names: Sequence[str],
    given: SensorModel,
    detector: Path,
    report: ProgressReport,
) -> Worth:
    """What the missing effects, unknown ones among them, are worth to a detector."""
    from training.worth import value_effects

    report.begin("measuring without each effect", len(names))
    missing = [one.effect for one in found.effects] + [one.name for one in found.unknowns]
    there = {effect.name for effect in found.sensor.effects}
    return value_effects(
        drive,
        names,
        found.sensor,
        [name for name in missing if name in there],
        detector,
        given=given,
        on_frame=report.advance,
    )


def _asked_for(text: str) -> type[Effect]:
    from sensors.effects.registry import find_effect
    from sensors.errors import SensorError

    kind = find_effect(text)
    if kind.neutral is None or kind.stage == "label":
        raise SensorError(
            f"effect {text}: cannot be asked for; give the class `neutral`, parameters that do nothing, "
            "and derive it from a stage before labels"
        )
    return kind
