"""`cosim detect`: what a trained detector finds in a drive, as KITTI's text files."""

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
        "detect", help="what a trained detector finds in a drive", description=__doc__
    )
    parser.add_argument(
        "checkpoint",
        type=Path,
        metavar="CHECKPOINT",
        help="of cosim train; or PointPillars of OpenPCDet, mmdetection3d",
    )
    parser.add_argument("drive", type=Path, metavar="DRIVE", help="simulated or real; needs no labels")
    parser.add_argument("--split", metavar="LIST", help="a list of its ImageSets/ (default: all frames)")
    parser.add_argument("--frames", type=Path, metavar="FILE", help="instead: names of frames, one a line")
    parser.add_argument("--least-score", type=float, default=0.05, metavar="P", help="leave out below (default: 0.05)")
    parser.add_argument(
        "--device", choices=("auto", "cpu", "cuda"), default="auto", help="default: a GPU if there is one"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="gets NAME.txt a frame")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Detect frame by frame, then write the files."""
    from training.data import Source
    from training.errors import TrainingError, demand_torch

    if not 0 <= options.least_score <= 1:
        raise TrainingError(f"--least-score is {options.least_score}; give a share from 0 to 1")
    drive, names = Source(drive=options.drive, split=options.split, frames=options.frames).open()
    demand_torch()
    from training.checkpoints import load_detector
    from training.devices import find_device
    from training.predict import predict, write_detections

    device = find_device(options.device)
    detector, classes = load_detector(options.checkpoint)
    with ProgressReport(console, "detecting", len(names)) as report:
        found = predict(
            detector.to(device),
            drive,
            names,
            classes,
            device,
            least_score=options.least_score,
            on_frame=report.advance,
        )
    write_detections(options.out, names, found)
    total = sum(len(some) for some in found)
    console.print(f"{total} detections in {len(names)} frames in {options.out}", soft_wrap=True, highlight=False)
    write_json(
        options.json, {"out": str(options.out), "frames": len(names), "detections": total, "classes": [*classes]}
    )
