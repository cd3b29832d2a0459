"""`cosim variants`: simulate the scans of a drive again with other sensors, from its stored hits."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, add_lidar, chosen_lidar, write_json


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "variants", help="simulate the scans of a drive again with other sensors", description=__doc__
    )
    parser.add_argument("drive", type=Path, metavar="DIR", help="folder of a simulated drive that contains hits/")
    parser.add_argument(
        "--variant",
        required=True,
        metavar="NAME|FILE[,…]",
        help="built-in sensors, beam patterns or sensor files, separated by commas; `all`: the eight of the paper",
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR2", help="output folder; every variant is a drive in it"
    )
    parser.add_argument(
        "--workers", type=int, default=1, metavar="W", help="number of processes that work on the frames (default: 1)"
    )
    parser.add_argument(
        "--picture", type=Path, metavar="FILE.png", help="also draw one frame of every variant into this file"
    )
    parser.add_argument("--frame", metavar="NAME", help="frame to draw (default: a frame with large objects)")
    parser.add_argument(
        "--beside", type=Path, metavar="KITTI", help="measured drive of which a frame is drawn for comparison"
    )
    add_lidar(parser)
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Make the variants and draw the picture."""
    from cosim.cli.progress import FrameReport
    from cosim.engine import LocalEngine
    from cosim.variants import make_variants

    engine = LocalEngine(options.workers)
    start_s = time.monotonic()
    with FrameReport(console, starting="reading the drive", working="measuring") as report:
        result = make_variants(
            chosen_lidar(options.drive, options),
            options.variant,
            options.out,
            engine=engine,
            on_start=report.start,
            on_event=report.follow,
        )
    seconds = time.monotonic() - start_s
    console.print(
        f"{len(result.points)} variants of {result.frames} frames in {result.folder} "
        f"({result.made} made in {seconds:.0f} s)"
    )
    if options.picture is not None:
        from cosim.variants.picture import write_picture

        folders = [options.out / stem for stem in result.points]
        write_picture(options.picture, folders, frame=options.frame, beside=options.beside)
        console.print(f"{options.picture}: one frame of each")
    write_json(
        options.json,
        {
            "out": str(result.folder),
            "frames": result.frames,
            "made": result.made,
            "points_per_frame": dict(result.points),
            "seconds": seconds,
            "frames_per_s": report.per_s,
        },
    )
