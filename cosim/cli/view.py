"""`cosim view`: pictures of a drive's frames and a page that shows them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "view", help="look at frames: points, boxes, images", description=__doc__
    )
    parser.add_argument("drive", type=Path, metavar="DIR", help="a drive, simulated or in KITTI's layout")
    parser.add_argument("--out", type=Path, metavar="OUT", help="folder of the page (default: DIR-view beside DIR)")
    parser.add_argument(
        "--frames",
        metavar="NAMES|COUNT",
        default="3",
        help="names with commas between; or how many, spread over the drive where labelled objects show largest "
        "(default: 3)",
    )
    add_common(parser)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Draw the frames, one after another, and write the page."""
    from cosim.kitti import Drive
    from cosim.view import choose_frames, write_view

    drive = Drive(options.drive)
    names = choose_frames(drive, options.frames)
    given = options.drive.resolve()
    folder = options.out or given.with_name(f"{given.name}-view")
    with console.status("drawing") as status:
        page = write_view(drive, names, folder, on_frame=lambda name: status.update(f"drawing frame {name}"))
    console.print(f"{len(names)} of {len(drive)} frames on {page}", soft_wrap=True)
