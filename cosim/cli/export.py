"""`cosim export`: a drive laid out for another framework."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, write_json
from cosim.cli.progress import ProgressReport


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "export", help="lay a drive out for another framework", description=__doc__
    )
    parser.add_argument("framework", choices=("openpcdet",), help="whose layout to write")
    parser.add_argument("drive", type=Path, metavar="DIR", help="a labelled drive, simulated or real")
    parser.add_argument("--out", type=Path, metavar="DIR2", help="folder to write (default: DIR-openpcdet beside DIR)")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Write the layout."""
    from cosim.cli.options import beside
    from cosim.drives.kitti import Drive
    from training.openpcdet import export_openpcdet

    drive, folder = Drive(options.drive), options.out or beside(options.drive, "openpcdet")
    with ProgressReport(console, "exporting", len(drive)) as report:
        counts = export_openpcdet(drive, folder, on_frame=report.advance)
    console.print(f"{counts['train']} training and {counts['val']} validation frames in {folder}", soft_wrap=True)
    write_json(options.json, {"out": str(folder), "frames": counts})
