"""Options that commands share."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.drives.writer import explained

if TYPE_CHECKING:
    from rich.console import Console

_BUNDLED = Path()


def add_common(parser: argparse.ArgumentParser, *, computes: bool = False) -> None:
    """Add `--quiet`, and `--json` for commands that compute a result."""
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    if computes:
        parser.add_argument("--json", type=Path, metavar="FILE", help="also write the result to this JSON file")


def add_lidar(parser: argparse.ArgumentParser) -> None:
    """Add `--lidar` for drives with several LiDARs; read it with `chosen_lidar`."""
    parser.add_argument(
        "--lidar",
        metavar="NAME",
        help="LiDAR to use if the drive has several: a folder in lidars/ (default: the main LiDAR)",
    )


def chosen_lidar(drive: Path, options: argparse.Namespace) -> Path:
    """Folder of the LiDAR that `--lidar` selects.

    Raises:
        DriveError: the drive has no such LiDAR.
    """
    from cosim.drives.kitti.layout import lidar_folder

    return lidar_folder(drive, options.lidar)


def add_frames(parser: argparse.ArgumentParser) -> None:
    """Add `--frames`, the frames to use; read it with `cosim.cli.frame_choice.chosen_frames`."""
    parser.add_argument(
        "--frames",
        metavar="NAMES|COUNT",
        help="frames to use: names separated by commas, or a number of evenly spaced frames (default: all)",
    )


def add_detector(parser: argparse.ArgumentParser, of: str) -> None:
    """Add `--detector`, to measure the influence of effects on a detector; read it with `chosen_detector`."""
    parser.add_argument(
        "--detector",
        type=Path,
        nargs="?",
        const=_BUNDLED,
        metavar="CHECKPOINT",
        help=f"also measure how the average precision of this detector changes without {of}; the drive needs labels "
        "(without CHECKPOINT: the bundled detector)",
    )


def chosen_detector(options: argparse.Namespace) -> Path | None:
    """Checkpoint that `--detector` selects; None if the option is not given.

    Raises:
        TrainingError: torch is not installed.
    """
    if options.detector is None:
        return None
    from training.errors import demand_torch
    from training.weights import shipped

    demand_torch()
    return shipped() if options.detector == _BUNDLED else options.detector


def say_notes(notes: Iterable[str], console: Console) -> None:
    """Print notes, one line each."""
    for note in notes:
        console.print(f"note: {note}", soft_wrap=True, highlight=False, markup=False)


def write_json(path: Path | None, result: dict[str, Any]) -> None:
    """Write a command's result to the file of `--json`, if it is given."""
    if path is not None:
        with explained(path):
            path.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


def without_nan(value: Any) -> Any:
    """Replace numbers that are not finite by None, because JSON has no representation for them."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def beside(drive: Path, word: str) -> Path:
    """Default output folder next to a drive: its name, its LiDAR's name if it is not the main one, and a word."""
    from cosim.drives.kitti.layout import LIDARS

    folder = drive.resolve()
    if folder.parent.name == LIDARS:
        base = folder.parent.parent
        return base.with_name(f"{base.name}-{folder.name}-{word}")
    return folder.with_name(f"{folder.name}-{word}")
