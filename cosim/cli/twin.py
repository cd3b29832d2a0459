"""`cosim twin`: gives a measured drive a twin, made from its labels and points."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.options import add_common, say_notes, write_json
from cosim.cli.progress import ProgressReport

if TYPE_CHECKING:
    from cosim.drives.kitti import Drive


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "twin", help="give a measured drive a twin made from its labels", description=__doc__
    )
    parser.add_argument("drive", type=Path, metavar="KITTI_DIR", help="velodyne/, calib/ and label_2/, or their parent")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="the drive to write")
    parser.add_argument(
        "--frames", metavar="FILE", help="frames to take: a file with a name a line, or one of ImageSets/"
    )
    parser.add_argument("--pattern", metavar="NAME", help="beam pattern (default: the drive's, or hdl64e_kitti)")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Make the twin frame by frame."""
    from cosim.discrepancy.labelled_twin import write_labelled_twin
    from cosim.drives.kitti import Drive

    drive = Drive(options.drive)
    names = _chosen(drive, options.frames)
    with ProgressReport(console, "making twins", len(names)) as report:
        summary = write_labelled_twin(drive, names, options.out, options.pattern, lambda name: report.advance())
    result = summary.as_json()
    say_notes(summary.notes, console)
    share, spread = result["points_trusted_share"], result["ground_sd_m"]
    console.print(
        f"{len(names)} frames in {options.out}: "
        + (f"{share:.0%} of the points trusted" if isinstance(share, float) else "no points")
        + (f", ground within {100 * spread:.1f} cm" if isinstance(spread, float) else ", no ground found")
        + f", its range usable in {result['frames_with_ground_range']}",
        soft_wrap=True,
        highlight=False,
        markup=False,
    )
    write_json(options.json, result)


def _chosen(drive: Drive, frames: str | None) -> tuple[str, ...]:
    from cosim.drives.kitti.layout import read_split
    from cosim.errors import DriveError

    if frames is None:
        return drive.frames
    if not Path(frames).is_file():
        return drive.split(frames)
    listed = tuple(dict.fromkeys(read_split(Path(frames))))
    absent = [name for name in listed if name not in drive]
    if absent or not listed:
        what = f"frame {absent[0]} is not in {drive.root}" if absent else "it lists no frame"
        raise DriveError(f"{frames}: {what}; list names of scans, one a line")
    return listed
