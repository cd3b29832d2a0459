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

_SHIPPED = Path()


def add_common(parser: argparse.ArgumentParser, *, computes: bool = False) -> None:
    """`--quiet`, and `--json` for commands that compute something."""
    parser.add_argument("--quiet", action="store_true", help="say nothing but errors")
    if computes:
        parser.add_argument("--json", type=Path, metavar="FILE", help="also write the result as JSON")


def add_lidar(parser: argparse.ArgumentParser) -> None:
    """`--lidar`: which LiDAR of a drive with several; `chosen_lidar` obeys."""
    parser.add_argument(
        "--lidar", metavar="NAME", help="of a drive with several LiDARs, one beside the first (lidars/NAME/)"
    )


def chosen_lidar(drive: Path, options: argparse.Namespace) -> Path:
    """The folder of the LiDAR that was asked for.

    Raises:
        DriveError: the drive has no such LiDAR.
    """
    from cosim.drives.kitti.layout import lidar_folder

    return lidar_folder(drive, options.lidar)


def add_frames(parser: argparse.ArgumentParser) -> None:
    """`--frames`: which frames of a drive take part; see `cosim.cli.frame_choice`."""
    parser.add_argument(
        "--frames", metavar="NAMES|COUNT", help="names with commas between; or how many, evenly spread (default: all)"
    )


def add_detector(parser: argparse.ArgumentParser, of: str) -> None:
    """`--detector`: also say what effects are worth to one; `asked_detector` obeys."""
    parser.add_argument(
        "--detector",
        type=Path,
        nargs="?",
        const=_SHIPPED,
        metavar="CHECKPOINT",
        help=f"also say how the average precision of a detector changes without {of}; the drive needs labels "
        "(no name: the detector that comes along)",
    )


def asked_detector(options: argparse.Namespace) -> Path | None:
    """The checkpoint that `--detector` means; None where it was not given.

    Raises:
        TrainingError: torch is not installed.
    """
    if options.detector is None:
        return None
    from training.errors import demand_torch
    from training.weights import shipped

    demand_torch()
    return shipped() if options.detector == _SHIPPED else options.detector


def say_notes(notes: Iterable[str], console: Console) -> None:
    """What could not be known, a line each."""
    for note in notes:
        console.print(f"note: {note}", soft_wrap=True, highlight=False, markup=False)


def write_json(path: Path | None, result: dict[str, Any]) -> None:
    """Write a command's result where `--json` asked for it."""
    if path is not None:
        with explained(path):
            path.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


def without_nan(value: Any) -> Any:
    """A result with null for numbers that are not finite, as JSON knows none."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def beside(drive: Path, word: str) -> Path:
    """The folder of a drive's results: its name, that of its LiDAR where it is not the first, and a word, beside it."""
    from cosim.drives.kitti.layout import LIDARS

    given = drive.resolve()
    if given.parent.name == LIDARS:
        base = given.parent.parent
        return base.with_name(f"{base.name}-{given.name}-{word}")
    return given.with_name(f"{given.name}-{word}")
