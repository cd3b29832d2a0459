"""`cosim calibrate`: what a sensor model lacks on a recording: pattern, map, diagnosis, until nothing changes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.engine_options import add_engine, engine_of
from cosim.cli.options import add_common, say_notes, without_nan, write_json
from cosim.cli.progress import ProgressReport
from cosim.cli.recording_options import add_recording, opened


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "calibrate", help="find a sensor model for a recording, without labels or a world", description=__doc__
    )
    add_recording(parser)
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder of everything; resumed by itself"
    )
    parser.add_argument(
        "--sensor", metavar="FILE", help="sensor file to begin with (default: the pattern in the points, and noise)"
    )
    parser.add_argument("--rounds", type=int, default=5, metavar="N", help="of map and diagnosis at most (default: 5)")
    add_engine(parser, "the segments of a long recording")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Calibrate, and write the page."""
    from cosim.errors import CosimError
    from cosim.recordings.calibration import calibrate
    from cosim.recordings.calibration.page import format_page, headline
    from cosim.report import write_page

    if options.rounds < 1:
        raise CosimError(f"--rounds {options.rounds}: one at least is needed")
    recording = opened(options, options.recording)
    with ProgressReport(console, "reading the recording") as report:
        found = calibrate(
            recording,
            options.out,
            options.sensor,
            most_rounds=options.rounds,
            engine=engine_of(options),
            on_step=report.say,
        )
    page = write_page(options.out, format_page(found))
    say_notes(found.rounds[-1].notes, console)
    console.print(headline(found), soft_wrap=True, highlight=False, markup=False)
    console.print(f"{page}; the sensor file to use: {found.sensor_out}", soft_wrap=True, highlight=False, markup=False)
    write_json(options.json, without_nan({**found.as_json(), "page": str(page)}))
