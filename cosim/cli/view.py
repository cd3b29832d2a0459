"""`cosim view`: show points, boxes and images of one drive, or of two drives side by side, on a page."""

from __future__ import annotations

import argparse
import os
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.options import add_common, add_lidar, beside, chosen_lidar, say_notes
from cosim.cli.progress import ProgressReport
from cosim.errors import DriveError

if TYPE_CHECKING:
    from cosim.drives.kitti import Drive
    from cosim.view.interactive import ShownDrives

_MAX_IN_FILE = 12
_PICTURE_COUNT = 3
_PORT = 8350


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "view", help="show points, boxes and images of one or two drives", description=__doc__
    )
    parser.add_argument("drive", type=Path, metavar="DIR", help="folder of a drive, simulated or in KITTI's layout")
    parser.add_argument("other", type=Path, nargs="?", metavar="DIR2", help="second drive, shown next to the first")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.html|FOLDER",
        help="one self-contained page; or a folder for the page and a page of pictures (default: DIR-view next to DIR)",
    )
    parser.add_argument(
        "--frames",
        metavar="NAMES|COUNT",
        help=f"frames to show: names separated by commas, or a number of evenly spaced frames (default: {_MAX_IN_FILE} "
        "in a file, all with --serve or --rerun)",
    )
    parser.add_argument(
        "--sensor",
        metavar="FILE|NAME",
        help="sensor model of which range residuals (measured − expected) are shown (default: the drive's own sensor, "
        "else its beam pattern without effects)",
    )
    parser.add_argument(
        "--serve", action="store_true", help="show the frames in a browser from a local server; writes no files"
    )
    parser.add_argument(
        "--port",
        type=int,
        default=_PORT,
        metavar="N",
        help=f"port of the server; 0: any free port (default: {_PORT})",
    )
    parser.add_argument(
        "--rerun",
        action="store_true",
        help="show the frames in the Rerun viewer; with --out FILE.rrd save them for it instead",
    )
    add_lidar(parser)
    add_common(parser)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Select the frames and show or write them."""
    from cosim.drives.kitti import Drive
    from cosim.view.interactive import show_drives

    if options.serve and (options.rerun or options.out):
        raise DriveError("--serve writes nothing and opens a browser; leave out --rerun and --out")
    drives = [Drive(chosen_lidar(path, options)) for path in (options.drive, options.other) if path is not None]
    for_file = not (options.serve or options.rerun)
    limit = _MAX_IN_FILE if for_file else None
    shown = show_drives(drives, options.frames, limit, options.sensor, for_file=for_file)
    say_notes(shown.notes, console)
    if options.serve:
        _serve(shown, options.port, console)
    elif options.rerun:
        _log(shown, options.out, console)
    else:
        _write(drives, shown, options, console)


def _write(drives: list[Drive], shown: ShownDrives, options: argparse.Namespace, console: Console) -> None:
    from cosim.view import richest_frames, write_view
    from cosim.view.interactive import write_interactive

    out: Path = options.out or beside(chosen_lidar(options.drive, options), "view")
    is_file = out.suffix.lower() in (".html", ".htm")
    pictured = (
        ()
        if is_file or len(drives) > 1
        else richest_frames(drives[0], tuple(step[0] for step in shown.steps), _PICTURE_COUNT)
    )
    page = out if is_file else out / "index.html"
    with ProgressReport(console, "packing", len(shown.steps)) as report:
        size = write_interactive(
            shown,
            page,
            pictures="pictures.html" if pictured else None,
            on_frame=report.advance,
        )
        if pictured:
            report.begin("drawing", len(pictured))
            write_view(
                drives[0],
                pictured,
                out,
                on_frame=report.advance,
                file="pictures.html",
            )
    more = "" if len(shown.steps) == len(drives[0]) else "; choose others with --frames, show all with --serve"
    console.print(
        f"{len(shown.steps)} of {len(drives[0])} frames on {page} ({size / 1e6:.1f} MB){more}", soft_wrap=True
    )
    if pictured:
        console.print(f"pictures of {len(pictured)} of them on {out / 'pictures.html'}", soft_wrap=True)


def _serve(shown: ShownDrives, port: int, console: Console) -> None:
    from cosim.view.interactive import ViewServer

    with ViewServer(shown, port) as server:
        print(server.address, flush=True)
        console.print(f"{len(shown.steps)} frames; stop with Ctrl-C", highlight=False)
        if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            console.print("stopped")


def _log(shown: ShownDrives, out: Path | None, console: Console) -> None:
    from cosim.view.interactive.rerun_log import log_to_rerun

    with ProgressReport(console, "logging", len(shown.steps)) as report:
        log_to_rerun(shown, out, on_frame=report.advance)
    where = f"in {out}" if out else "in Rerun's viewer"
    console.print(f"{len(shown.steps)} frames {where}", soft_wrap=True)
