"""`cosim detect`: what a trained detector finds in a drive or a recording, as KITTI's text files."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.options import add_common, beside, say_notes, write_json
from cosim.cli.progress import ProgressReport
from cosim.cli.recording_options import add_points, point_options

if TYPE_CHECKING:
    from cosim.drives.kitti import Labels
    from training.recorded import RecordedFrames


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "detect", help="what a trained detector finds in a drive or a recording", description=__doc__
    )
    parser.add_argument(
        "checkpoint",
        type=Path,
        nargs="?",
        metavar="CHECKPOINT",
        help="of cosim train; or PointPillars of OpenPCDet, mmdetection3d (default: the detector that comes along)",
    )
    parser.add_argument(
        "drive", type=Path, metavar="DRIVE", help="simulated or real, labels are not needed; or a recording's scans"
    )
    parser.add_argument("--split", metavar="LIST", help="a list of its ImageSets/ (default: all frames)")
    parser.add_argument("--frames", type=Path, metavar="FILE", help="instead: names of frames, one a line")
    parser.add_argument("--least-score", type=float, default=0.05, metavar="P", help="leave out below (default: 0.05)")
    parser.add_argument(
        "--device", choices=("auto", "cpu", "cuda"), default="auto", help="default: a GPU if there is one"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="gets NAME.txt a frame (default: DRIVE-detections)")
    add_points(parser)
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Detect frame by frame, then write the files."""
    from training.errors import TrainingError, demand_torch

    if not 0 <= options.least_score <= 1:
        raise TrainingError(f"--least-score is {options.least_score}; give a share from 0 to 1")
    demand_torch()
    folder = options.out or beside(options.drive, "detections")
    names, found, classes = _recorded(options, console, folder) if _is_recording(options) else _driven(options, console)
    from training.predict import write_detections

    write_detections(folder, names, found)
    total = sum(len(some) for some in found)
    console.print(f"{total} detections in {len(names)} frames in {folder}", soft_wrap=True, highlight=False)
    write_json(options.json, {"out": str(folder), "frames": len(names), "detections": total, "classes": [*classes]})


def _is_recording(options: argparse.Namespace) -> bool:
    """Whether these are scans without a calibration, so that they are no drive."""
    path: Path = options.drive
    if options.split or options.frames or not path.exists():
        return False
    return not any((path / below / "calib").is_dir() for below in ("", "training", "testing"))


def _driven(options: argparse.Namespace, console: Console) -> tuple[Sequence[str], list[Labels], Sequence[str]]:
    from training.data import Source

    drive, names = Source(drive=options.drive, split=options.split, frames=options.frames).open()
    return names, *_found(options, console, (drive[name] for name in names), len(names))


def _recorded(
    options: argparse.Namespace, console: Console, folder: Path
) -> tuple[Sequence[str], list[Labels], Sequence[str]]:
    """Detections in a recording; the calibration that they refer to is written beside them, in `calib/`."""
    from cosim.recordings import open_recording
    from training.recorded import LEARNT_HEIGHT_M, RecordedFrames, height_above_ground, write_calibrations

    recording = open_recording(options.drive, **point_options(options))
    height_m = height_above_ground(recording)
    frames = RecordedFrames(recording, LEARNT_HEIGHT_M if height_m is None else height_m)
    say_notes([_height_note(frames, height_m), *recording.notes], console)
    found, classes = _found(options, console, frames, len(recording))
    write_calibrations(folder / "calib", frames.names)
    return frames.names, [frames.lowered(some) for some in found], classes


def _height_note(frames: RecordedFrames, found_m: float | None) -> str:
    how = "no ground was found: " if found_m is None else ""
    return (
        f"{how}the LiDAR is taken to be {frames.height_m:.2f} m above the ground and to look ahead along x; "
        "`mount: {height_m: …}` in recording.yaml says otherwise"
    )


def _found(
    options: argparse.Namespace, console: Console, frames: Any, count: int
) -> tuple[list[Labels], Sequence[str]]:
    from training.checkpoints import load_detector
    from training.devices import find_device
    from training.predict import predict
    from training.weights import shipped

    device = find_device(options.device)
    detector, classes = load_detector(options.checkpoint or shipped())
    with ProgressReport(console, "detecting", count) as report:
        found = predict(
            detector.to(device), frames, classes, device, least_score=options.least_score, on_frame=report.advance
        )
    return found, classes
