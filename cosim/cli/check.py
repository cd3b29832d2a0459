"""`cosim check`: verify the checksums of a drive's files and record the frames of damaged files again."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, write_json

_SHOWN = 10


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "check", help="verify a drive's files and record damaged frames again", description=__doc__
    )
    parser.add_argument("drive", type=Path, metavar="DIR", help="folder of a drive written by cosim")
    parser.add_argument("--no-repair", action="store_true", help="report damaged files without changing anything")
    parser.add_argument(
        "--workers",
        type=int,
        default=1,
        metavar="W",
        help="number of processes that record damaged frames (default: 1)",
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Verify the files, report damaged ones, and repair them unless `--no-repair` is given."""
    from cosim.cli.progress import FrameReport, ProgressReport
    from cosim.drives.check import CheckError, check_drive, repair_drive
    from cosim.engine import LocalEngine

    engine = LocalEngine(options.workers)
    with ProgressReport(console, "reading checksums", unit="files") as report:
        result = check_drive(options.drive, lambda files: report.begin("comparing checksums", files), report.advance)
    for path, state in list(result.damaged.items())[:_SHOWN]:
        console.print(f"{path}: {state}", highlight=False)
    summary = f"{len(result.damaged)} of {result.files:,} files are damaged; {len(result.frames)} frames need them"
    if result.damaged and options.no_repair:
        raise CheckError(f"{options.drive}: {summary}; leave out --no-repair to record them again")
    if result.damaged:
        console.print(summary)
        with FrameReport(console, starting="building the town", working="recording") as report:
            repair_drive(result, engine=engine, on_start=report.start, on_event=report.follow)
        console.print(f"{len(result.frames)} frames recorded again, with the same checksums as before")
    else:
        console.print(f"{result.files:,} files, all as they were written")
    write_json(
        options.json,
        {"files": result.files, "damaged": dict(result.damaged), "repaired": list(result.frames)},
    )
