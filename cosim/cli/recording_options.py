"""Options of the commands that read recordings."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cosim.recordings import Recording


def add_recording(parser: argparse.ArgumentParser, *, path: bool = True) -> None:
    """The recording, and what its files do not say."""
    if path:
        parser.add_argument("recording", type=Path, metavar="RECORDING", help="folder of scans, bag or packet capture")
    parser.add_argument(
        "--scans", metavar="GLOB", help="file names of the scans in the folder, for example 'raw_*.bin'"
    )
    parser.add_argument("--topic", metavar="NAME", help="topic to read if a bag has several topics with point clouds")
    add_points(parser)
    parser.add_argument("--sweep-s", type=float, metavar="S", help="duration of one revolution [s]")
    parser.add_argument(
        "--poses",
        metavar="FILE",
        help="poses in KITTI's or TUM's format (default: a file of poses in the folder, otherwise odometry)",
    )
    parser.add_argument(
        "--accept",
        metavar="CHECKS",
        help="continue if one of these checks finds an error, and write a note instead; for example travel,places",
    )
    parser.add_argument(
        "--skip-damaged", action="store_true", help="skip scans that cannot be read; they are counted and named"
    )


def opened(options: argparse.Namespace, path: Path) -> Recording:
    """The recording that the options describe.

    Raises:
        CosimError: it cannot be read.
    """
    from cosim.recordings import open_recording

    names = ("scans", "topic", "sweep_s", "poses")
    given: dict[str, Any] = {name: getattr(options, name) for name in names}
    accept = None if options.accept is None else tuple(word.strip() for word in options.accept.split(","))
    given |= {"accept": accept, "skip_damaged": options.skip_damaged or None}
    return open_recording(path, **given, **point_options(options))


def point_options(options: argparse.Namespace) -> dict[str, Any]:
    """Statements of the command line about point files; None for what it does not state."""
    names = ("columns", "intensity_scale", "axes", "metres")
    return {name: getattr(options, name) for name in names} | {"flip_y": options.flip_y or None}


def add_points(parser: argparse.ArgumentParser) -> None:
    """Add options that state the meaning of numbers in point files where the files do not show it."""
    parser.add_argument(
        "--columns",
        metavar="NAMES",
        help="meaning of each column of the scans, for example x,y,z,intensity,_ (_: not used)",
    )
    parser.add_argument(
        "--intensity-scale", type=float, metavar="X", help="stored value of full intensity, for example 255"
    )
    parser.add_argument(
        "--axes", metavar="X,Y,Z", help="stored axes that point forward, left and up, for example x,-y,z"
    )
    parser.add_argument("--flip-y", action="store_true", help="mirror y, because the stored y points to the right")
    parser.add_argument(
        "--metres", type=float, metavar="M", help="length of one unit of x, y, z [m], for example 0.001"
    )
