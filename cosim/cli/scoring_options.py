"""Options of commands that compare detections with labels."""

from __future__ import annotations

import argparse
from pathlib import Path

_DRAWS_UP_TO = 500  # maximum number of frames for which intervals are computed by default


def add_scored(parser: argparse.ArgumentParser) -> None:
    """Add `--detections`, `--labels`, `--frames` and `--classes`."""
    parser.add_argument(
        "--detections",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder of detections: one KITTI text file NAME.txt per frame, 16 columns, the last one the score",
    )
    parser.add_argument("--labels", type=Path, required=True, metavar="DIR", help="label_2/ folder of KITTI text files")
    parser.add_argument(
        "--frames",
        type=Path,
        metavar="FILE",
        help="names of the frames to score, one per line; a frame without a detection file counts as having no "
        "detections (default: all frames of the labels, each of which needs a detection file)",
    )
    parser.add_argument(
        "--classes",
        nargs="+",
        default=[],
        metavar="NAME=CLASS",
        help="class names in the files and the corresponding KITTI classes, for example Vehicle=Car",
    )


def add_draws(parser: argparse.ArgumentParser, of: str, usual: int) -> None:
    """Add `--bootstrap` and `--seed` of confidence intervals; read them with `demand_draws` and `chosen_draws`."""
    parser.add_argument(
        "--bootstrap",
        type=int,
        metavar="DRAWS",
        help=f"number of bootstrap samples for the 95 %% confidence intervals{of}; 0: no intervals (default: {usual} "
        f"for up to {_DRAWS_UP_TO} frames, else 0)",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="random seed of the bootstrap (default: 0)")


def demand_draws(options: argparse.Namespace) -> None:
    """Check the number of bootstrap samples.

    Raises:
        EvaluationError: it is negative.
    """
    from training.errors import EvaluationError

    if options.bootstrap is not None and options.bootstrap < 0:
        raise EvaluationError(f"--bootstrap is {options.bootstrap}; give a number of samples, or 0 for no intervals")


def chosen_draws(options: argparse.Namespace, frames: int, usual: int) -> int:
    """Number of bootstrap samples for a number of frames."""
    if options.bootstrap is not None:
        return options.bootstrap
    return usual if frames <= _DRAWS_UP_TO else 0
