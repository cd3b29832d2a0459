"""`cosim view`: look into one drive, or two side by side: points, boxes and images, on a page of its own."""

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

_MOST_IN_A_FILE = 12
_PICTURED = 3
_PORT = 8350


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "view", help="look into a drive, or two side by side: points, boxes, images", description=__doc__
    )
    parser.add_argument("drive", type=Path, metavar="DIR", help="a drive, simulated or in KITTI's layout")
    parser.add_argument("other", type=Path, nargs="?", metavar="DIR2", help="another one, to be shown beside it")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.html|FOLDER",
        help="one file with everything in it; or a folder for it and a page of pictures (default: DIR-view beside DIR)",
    )
    parser.add_argument(
        "--frames",
        metavar="NAMES|COUNT",
        help=f"names with commas between, or how many, evenly spread (default: {_MOST_IN_A_FILE} in a file, else all)",
    )
    parser.add_argument(
        "--sensor",
        metavar="FILE",
        help="sensor whose residuals are shown, measured − expected range (default: the drive's own, else its bare "
        "pattern)",
    )
    parser.add_argument("--serve", action="store_true", help="show all frames in a browser; writes nothing")
    parser.add_argument(
        "--port", type=int, default=_PORT, metavar="N", help=f"where to serve, 0: any that is free (default: {_PORT})"
    )
    parser.add_argument("--rerun", action="store_true", help="show the frames in Rerun's viewer; --out FILE.rrd saves")
    add_lidar(parser)
    add_common(parser)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Choose the frames and show them as asked."""
    from cosim.drives.kitti import Drive
    from cosim.view.interactive import show_drives

    if options.serve and (options.rerun or options.out):
        raise DriveError("--serve writes nothing and opens a browser; leave out --rerun and --out")
    drives = [Drive(chosen_lidar(path, options)) for path in (options.drive, options.other) if path is not None]
    for_file = not (options.serve or options.rerun)
    most = _MOST_IN_A_FILE if for_file else None
    shown = show_drives(drives, options.frames, most, options.sensor, for_file=for_file)
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
    alone = out.suffix.lower() in (".html", ".htm")
    pictured = (
        () if alone or len(drives) > 1 else richest_frames(drives[0], tuple(s[0] for s in shown.steps), _PICTURED)
    )
    page = out if alone else out / "index.html"
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
    more = "" if len(shown.steps) == len(drives[0]) else "; --frames takes others, --serve shows all"
    console.print(
        f"{len(shown.steps)} of {len(drives[0])} frames on {page} ({size / 1e6:.1f} MB){more}", soft_wrap=True
    )
    if pictured:
        console.print(f"pictures of {len(pictured)} of them on {out / 'pictures.html'}", soft_wrap=True)


def _serve(shown: ShownDrives, port: int, console: Console) -> None:
    from cosim.view.interactive import ViewServer

    with ViewServer(shown, port) as server:
        print(server.address, flush=True)
        console.print(f"{len(shown.steps)} frames; Ctrl-C ends", highlight=False)
        if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            console.print("ended")


def _log(shown: ShownDrives, out: Path | None, console: Console) -> None:
    from cosim.view.interactive.rerun_log import log_to_rerun

    with ProgressReport(console, "logging", len(shown.steps)) as report:
        log_to_rerun(shown, out, on_frame=report.advance)
    where = f"in {out}" if out else "in Rerun's viewer"
    console.print(f"{len(shown.steps)} frames {where}", soft_wrap=True)
