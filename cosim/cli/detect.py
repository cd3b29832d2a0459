"""`cosim detect`: run a trained detector on a drive or a recording and write KITTI text files."""

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
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "detect", help="run a trained detector on a drive or a recording", description=__doc__
    )
    parser.add_argument(
        "checkpoint",
        type=Path,
        nargs="?",
        metavar="CHECKPOINT",
        help="checkpoint of cosim train, or of PointPillars from OpenPCDet or mmdetection3d (default: the bundled "
        "detector)",
    )
    parser.add_argument(
        "drive",
        type=Path,
        metavar="DRIVE",
        help="folder of a simulated or real drive (labels are not needed), or the scans of a recording",
    )
    parser.add_argument("--split", metavar="LIST", help="list in ImageSets/ of the frames to use (default: all frames)")
    parser.add_argument(
        "--frames", type=Path, metavar="FILE", help="file with the names of the frames to use, one per line"
    )
    parser.add_argument(
        "--least-score",
        type=float,
        default=0.05,
        metavar="P",
        help="minimum score of the detections to write, 0 to 1 (default: 0.05)",
    )
    parser.add_argument(
        "--device",
        choices=("auto", "cpu", "cuda"),
        default="auto",
        help="device that runs the detector; auto: a GPU if available, else the CPU (default: auto)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="output folder, one NAME.txt per frame (default: DRIVE-detections)"
    )
    add_points(parser)
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Run the detector on all frames, then write the files."""
    from training.errors import TrainingError, demand_torch

    if not 0 <= options.least_score <= 1:
        raise TrainingError(f"--least-score is {options.least_score}; give a number from 0 to 1")
    demand_torch()
    folder = options.out or beside(options.drive, "detections")
    names, detections, classes = (
        _detect_in_recording(options, console, folder) if _is_recording(options) else _detect_in_drive(options, console)
    )
    from training.predict import write_detections

    write_detections(folder, names, detections)
    total = sum(len(labels) for labels in detections)
    console.print(f"{total} detections in {len(names)} frames in {folder}", soft_wrap=True, highlight=False)
    write_json(options.json, {"out": str(folder), "frames": len(names), "detections": total, "classes": [*classes]})


def _is_recording(options: argparse.Namespace) -> bool:
    """Whether the path contains scans without a calibration, so that it is not a drive."""
    path: Path = options.drive
    if options.split or options.frames or not path.exists():
        return False
    from cosim.drives.kitti.layout import find_layout
    from cosim.errors import DriveError

    try:
        find_layout(path)
    except DriveError:
        return True
    return False


def _detect_in_drive(
    options: argparse.Namespace, console: Console
) -> tuple[Sequence[str], list[Labels], Sequence[str]]:
    from training.data import FrameSource

    drive, names = FrameSource(drive=options.drive, split=options.split, frames=options.frames).open()
    return names, *_detect(options, console, (drive[name] for name in names), len(names))


def _detect_in_recording(
    options: argparse.Namespace, console: Console, folder: Path
) -> tuple[Sequence[str], list[Labels], Sequence[str]]:
    """Detect objects in a recording; the calibration of the detections is written to the subfolder `calib/`."""
    from cosim.recordings import open_recording
    from training.recorded import LEARNT_HEIGHT_M, RecordedFrames, height_above_ground, write_calibrations

    recording = open_recording(options.drive, **point_options(options))
    height_m = height_above_ground(recording)
    frames = RecordedFrames(recording, LEARNT_HEIGHT_M if height_m is None else height_m)
    say_notes([_height_note(frames, height_m), *recording.notes], console)
    detections, classes = _detect(options, console, frames, len(recording))
    write_calibrations(folder / "calib", frames.names)
    return frames.names, [frames.lowered(labels) for labels in detections], classes


def _height_note(frames: RecordedFrames, estimated_m: float | None) -> str:
    reason = "no ground was found: " if estimated_m is None else ""
    return (
        f"{reason}the LiDAR is assumed to be {frames.height_m:.2f} m above the ground with x pointing forward; "
        "`mount: {height_m: …}` in recording.yaml changes this"
    )


def _detect(
    options: argparse.Namespace, console: Console, frames: Any, count: int
) -> tuple[list[Labels], Sequence[str]]:
    from training.checkpoints import load_detector
    from training.devices import find_device
    from training.predict import predict
    from training.weights import shipped

    device = find_device(options.device)
    detector, classes = load_detector(options.checkpoint or shipped())
    with ProgressReport(console, "detecting", count) as report:
        detections = predict(
            detector.to(device), frames, classes, device, least_score=options.least_score, on_frame=report.advance
        )
    return detections, classes
