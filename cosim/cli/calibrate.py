"""`cosim calibrate`: fit a sensor model to the scans of a recording: pattern, map and diagnosis, in several rounds."""

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
    parser.add_argument(
        "recording",
        type=Path,
        nargs="+",
        metavar="RECORDING",
        help="folder of scans, bag or packet capture; several recordings of one sensor are calibrated together",
    )
    add_recording(parser, path=False)
    parser.add_argument(
        "--compare",
        action="store_true",
        help="the recordings are from different sensors or times: test which parameters differ between them",
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="output folder; an unfinished run in it is resumed"
    )
    parser.add_argument(
        "--sensor", metavar="FILE", help="initial sensor file (default: pattern and noise estimated from the points)"
    )
    parser.add_argument(
        "--rounds", type=int, default=5, metavar="N", help="maximum number of rounds of map and diagnosis (default: 5)"
    )
    add_engine(parser, "the segments of a long recording")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Calibrate, and write the page."""
    from cosim.errors import CosimError

    if options.rounds < 1:
        raise CosimError(f"--rounds {options.rounds}: one at least is needed")
    if options.compare and len(options.recording) < 2:
        raise CosimError("--compare: give two drives or more")
    if len(options.recording) > 1:
        _calibrate_drives(options, console)
        return
    from cosim.recordings.calibration import calibrate
    from cosim.recordings.calibration.page import format_page, headline
    from cosim.report import write_page

    recording = opened(options, options.recording[0])
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


def _calibrate_drives(options: argparse.Namespace, console: Console) -> None:
    """Calibrate several drives, combine and compare them, and write a page of each and of all."""
    from cosim.recordings.calibration.compare_page import format_comparison, headline
    from cosim.recordings.calibration.drives import calibrate_drives
    from cosim.recordings.calibration.page import format_page
    from cosim.report import write_page

    recordings = [opened(options, path) for path in options.recording]
    with ProgressReport(console, "reading the recordings") as report:
        found = calibrate_drives(
            recordings,
            options.out,
            options.sensor,
            most_rounds=options.rounds,
            is_one_sensor=not options.compare,
            engine=engine_of(options),
            on_step=report.say,
        )
    for one in found.calibrations:
        write_page(one.folder, format_page(one))
    page = write_page(options.out, format_comparison(found))
    console.print(headline(found), soft_wrap=True, highlight=False, markup=False)
    console.print(f"{page}; the sensor file to use: {found.sensor_out}", soft_wrap=True, highlight=False, markup=False)
    write_json(options.json, without_nan({**found.as_json(), "page": str(page)}))
