"""`cosim compare`: measure the error of a sensor model against measurements, and show where it is large."""

from __future__ import annotations

import argparse
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
    from cosim.discrepancy.data.frames import TracedFrame
    from cosim.discrepancy.scores import FrameScores


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "compare", help="measure the error of a sensor model against measurements", description=__doc__
    )
    parser.add_argument("drive", type=Path, metavar="DRIVE", help="folder of a measured drive with a twin")
    parser.add_argument(
        "--sensor", required=True, metavar="FILE|NAME", help="sensor file, or the name of a built-in sensor or pattern"
    )
    add_lidar(parser)
    add_frames(parser)
    add_detector(parser, "each of the model's effects")
    parser.add_argument(
        "--out", type=Path, metavar="PAGE_DIR", help="folder of the report page (default: DRIVE-compare)"
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Compare all frames, then write the page."""
    from cosim.cli.frame_choice import chosen_frames
    from cosim.discrepancy import compare
    from cosim.discrepancy.data.checks import opened
    from cosim.discrepancy.report import format_comparison
    from cosim.report import write_page
    from sensors.sensor_model import load_sensor

    path = chosen_lidar(options.drive, options)
    sensor, drive, detector = load_sensor(options.sensor), opened(path), chosen_detector(options)
    names = chosen_frames(drive, options.frames) if options.frames else drive.frames
    folder = options.out or beside(path, "compare")
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with ProgressReport(console, "comparing", len(names)) as report:

        def on_frame(frame: TracedFrame, scores: FrameScores) -> None:
            report.advance()

        result = compare(drive, sensor, frames=names, on_frame=on_frame)
        if detector is not None:
            from cosim.variants.rescans import scan_effects
            from training.worth import value_effects

            report.begin("measuring without each effect", len(names))
            effects = scan_effects(sensor)
            worth = value_effects(drive, names, sensor, effects, detector, on_frame=report.advance)
            result = replace(result, worth=worth)
    command = f"cosim diagnose {path} --sensor {options.sensor}"
    page = write_page(folder, format_comparison(result, command))
    if not options.quiet:
        print(result)
    say_notes(result.notes, console)
    console.print(f"{result.totals.frames} frames on {page}", soft_wrap=True, highlight=False)
    write_json(options.json, without_nan(result.to_json()))
