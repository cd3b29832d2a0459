"""`cosim pattern`: estimate the beam pattern of a recording from its points."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, beside, say_notes, write_json
from cosim.cli.progress import ProgressReport
from cosim.cli.recording_options import add_recording, opened


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "pattern", help="estimate the beam pattern of a recording from its points", description=__doc__
    )
    add_recording(parser)
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="pattern file to write, for example my_lidar.yaml"
    )
    parser.add_argument(
        "--page", type=Path, metavar="DIR", help="folder of the report page (default: FILE-pattern next to FILE)"
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Estimate the pattern, write it and its page."""
    from cosim.drives.writer import explained
    from cosim.recordings.pattern import find_pattern, format_page
    from cosim.recordings.pattern.find import SCANS
    from cosim.report import write_page

    recording = opened(options, options.recording)
    with ProgressReport(console, "reading scans", min(SCANS, len(recording))) as report:
        found = find_pattern(recording, options.out.stem, on_scan=report.advance)
    with explained(options.out):
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(found.pattern.to_yaml(), encoding="utf-8")
    page = write_page(
        options.page or beside(options.out.with_suffix(""), "pattern"),
        format_page(found, f"Beam pattern of {recording.path.name}"),
    )
    say_notes((*recording.notes, *found.notes), console)
    lasers = found.lasers
    console.print(
        f"{options.out}: {len(lasers)} lasers{_or(found.alternatives)}, "
        f"{lasers.elevation_deg[0]:+.2f}° to {lasers.elevation_deg[-1]:+.2f}°, "
        f"{found.turning.firings} firings per revolution, {lasers.share:.1%} of the points on a beam; page {page}",
        soft_wrap=True,
        highlight=False,
        markup=False,
    )
    write_json(options.json, {**found.as_json(), "out": str(options.out), "page": str(page)})


def _or(counts: tuple[int, ...]) -> str:
    """Other counts that the points allow, in words."""
    return f" (or {' or '.join(map(str, counts))})" if counts else ""
