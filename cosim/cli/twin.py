"""`cosim twin`: make a twin of measurements, from their labels if they have any, otherwise from a map of the scans."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.engine_options import add_engine, engine_of
from cosim.cli.options import add_common, beside, say_notes, without_nan, write_json
from cosim.cli.progress import ProgressReport
from cosim.cli.recording_options import add_recording, opened

if TYPE_CHECKING:
    from cosim.drives.kitti import Drive


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "twin",
        help="make a twin for measurements, from labels or from scans",
        description=__doc__,
    )
    parser.add_argument(
        "drive",
        type=Path,
        metavar="DIR",
        help="labelled drive (folder with velodyne/, calib/ and label_2/, or its parent), or a recording (folder of "
        "scans, bag or packet capture)",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the drive to write")
    parser.add_argument(
        "--frames",
        metavar="FILE|LIST",
        help="labelled frames to use: a file with one name per line, or a list in ImageSets/ (default: all)",
    )
    parser.add_argument(
        "--pattern",
        metavar="FILE|NAME",
        help="beam pattern (default for a labelled drive: its own, or hdl64e_kitti if it has none; for a recording: "
        "estimated from the points)",
    )
    parser.add_argument(
        "--page", type=Path, metavar="PAGE", help="folder of the report page of a recording (default: DIR-twin)"
    )
    add_recording(parser, path=False)
    add_engine(parser, "the segments of a long recording")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Make the twin, from labels if there are any."""
    if _is_labelled(options.drive) or not options.drive.exists():
        _from_labels(options, console)
    else:
        _from_scans(options, console)


def _is_labelled(path: Path) -> bool:
    """Whether a folder has KITTI's layout: scans, also those of a raw drive, together with calibrations or labels."""
    from cosim.drives.kitti.layout import holds_scans

    roots = (path, path / "training", path / "testing")
    return any(holds_scans(root) and ((root / "calib").is_dir() or (root / "label_2").is_dir()) for root in roots)


def _from_scans(options: argparse.Namespace, console: Console) -> None:
    from cosim.errors import CosimError
    from cosim.recordings.mapping import write_recording_twin
    from cosim.recordings.mapping.page import format_page
    from cosim.report import write_page

    if options.frames is not None:
        raise CosimError(
            "--frames selects labelled frames, but a map uses all scans; leave it out, or select scans with --scans"
        )
    recording = opened(options, options.drive)
    with ProgressReport(console, "making the twin") as report:
        twin = write_recording_twin(
            recording, options.out, options.pattern, engine=engine_of(options), on_step=report.say
        )
    page = write_page(options.page or beside(options.out, "twin"), format_page(twin))
    result = twin.as_json()
    say_notes(twin.notes, console)
    held = result["error_held_out_m"]
    console.print(
        f"{result['scans']} scans in {options.out}: {result['path_m']:.1f} m, {result['surfels']} surfaces, "
        f"{1000 * result['thickness_ground_m']:.1f} mm thick on the ground"
        + (f", held-out scans within {1000 * held:.1f} mm" if held else "")
        + f"; page {page}",
        soft_wrap=True,
        highlight=False,
        markup=False,
    )
    write_json(options.json, without_nan({**result, "page": str(page)}))


def _from_labels(options: argparse.Namespace, console: Console) -> None:
    from cosim.drives.kitti import Drive
    from cosim.labelled_twin import write_labelled_twin

    drive = Drive(options.drive)
    names = _select_frames(drive, options.frames)
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


def _select_frames(drive: Drive, frames: str | None) -> tuple[str, ...]:
    from cosim.drives.kitti.layout import read_split
    from cosim.errors import DriveError

    if frames is None:
        return drive.frames
    if not Path(frames).is_file():
        return drive.split(frames)
    listed = tuple(dict.fromkeys(read_split(Path(frames))))
    absent = [name for name in listed if name not in drive]
    if absent or not listed:
        problem = f"frame {absent[0]} is not in {drive.root}" if absent else "it lists no frame"
        raise DriveError(f"{frames}: {problem}; list names of scans, one per line")
    return listed
