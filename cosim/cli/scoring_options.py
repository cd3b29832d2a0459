"""Options of commands that hold detections against labels."""

from __future__ import annotations

import argparse
from pathlib import Path

_DRAWS_UP_TO = 500  # frames for which intervals are drawn unless asked for


def add_scored(parser: argparse.ArgumentParser) -> None:
    """`--detections`, `--labels` and `--frames`: what is scored."""
    parser.add_argument(
        "--detections", type=Path, required=True, metavar="DIR", help="NAME.txt a frame, 16 columns, the last a score"
    )
    parser.add_argument("--labels", type=Path, required=True, metavar="DIR", help="a label_2/ folder")
    parser.add_argument(
        "--frames", type=Path, metavar="FILE", help="names to score, one a line; absent detection files hold none"
    )
    parser.add_argument(
        "--classes",
        nargs="+",
        default=[],
        metavar="NAME=CLASS",
        help="names of classes in the files and the KITTI classes that they mean, as Vehicle=Car",
    )


def add_draws(parser: argparse.ArgumentParser, of: str, usual: int) -> None:
    """`--bootstrap` and `--seed` of intervals; `demand_draws` and `chosen_draws` obey."""
    parser.add_argument(
        "--bootstrap",
        type=int,
        metavar="DRAWS",
        help=f"draws of the 95 %% intervals{of} (default: {usual} up to {_DRAWS_UP_TO} frames, else none)",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of those draws (default: 0)")


def demand_draws(options: argparse.Namespace) -> None:
    """Refuse a number of draws that is none.

    Raises:
        EvaluationError: it is negative.
    """
    from training.errors import EvaluationError

    if options.bootstrap is not None and options.bootstrap < 0:
        raise EvaluationError(f"--bootstrap is {options.bootstrap}; give a number of draws, 0 for none")


def chosen_draws(options: argparse.Namespace, frames: int, usual: int) -> int:
    """How many draws to make for so many frames."""
    if options.bootstrap is not None:
        return options.bootstrap
    return usual if frames <= _DRAWS_UP_TO else 0
