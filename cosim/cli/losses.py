"""`cosim losses`: which kinds of errors take how much of a detector's average precision, and where."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, beside, write_json
from cosim.cli.progress import ProgressReport

_CLASSES = ("Car", "Pedestrian", "Cyclist")
_DIFFICULTIES = ("easy", "moderate", "hard")
_DRAWS, _DRAWS_UP_TO = 300, 500


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "losses",
        help="which kinds of errors take how much of a detector's average precision",
        description=__doc__,
    )
    parser.add_argument(
        "--detections", type=Path, required=True, metavar="DIR", help="NAME.txt a frame, 16 columns, the last a score"
    )
    parser.add_argument("--labels", type=Path, required=True, metavar="DIR", help="a label_2/ folder")
    parser.add_argument(
        "--frames", type=Path, metavar="FILE", help="names to score, one a line; absent detection files hold none"
    )
    parser.add_argument(
        "--against", type=Path, metavar="DIR", help="detections to compare with: another detector's, or of other frames"
    )
    parser.add_argument("--against-labels", type=Path, metavar="DIR", help="their labels (default: those of --labels)")
    parser.add_argument("--against-frames", type=Path, metavar="FILE", help="their names (default: those of --frames)")
    parser.add_argument("--class", dest="name", choices=_CLASSES, default="Car", help="default: Car")
    parser.add_argument("--difficulty", choices=_DIFFICULTIES, default="moderate", help="default: moderate")
    parser.add_argument(
        "--bootstrap",
        type=int,
        metavar="DRAWS",
        help=f"draws of the 95 %% intervals (default: {_DRAWS} up to {_DRAWS_UP_TO} frames, else none)",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of those draws (default: 0)")
    parser.add_argument("--out", type=Path, metavar="PAGE_DIR", help="folder of the page (default: DIR-losses)")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Read, split, write the page."""
    from cosim.report import write_page
    from training.errors import EvaluationError
    from training.evaluation import read_results
    from training.evaluation.losses import SETS_MENDED, as_json, drawn_frames, find_losses, format_losses
    from training.evaluation.slices import scans_beside

    if options.bootstrap is not None and options.bootstrap < 0:
        raise EvaluationError(f"--bootstrap is {options.bootstrap}; give a number of draws, 0 for none")
    given = _given(options)
    with ProgressReport(console, "reading") as report:
        scored = [read_results(*places) for places in given]
        few = max(len(some.names) for some in scored) <= _DRAWS_UP_TO
        draws = options.bootstrap if options.bootstrap is not None else _DRAWS if few else 0
        times = drawn_frames(scored[0], scored[-1], draws, options.seed)
        report.begin("mending errors", SETS_MENDED * len(given))
        sets = [
            find_losses(
                some,
                options.name,
                options.difficulty,
                title,
                drive=scans_beside(labels),
                times=drawn,
                on_set=report.advance,
            )
            for title, some, drawn, (_, labels, _) in zip(_titles(given), scored, times, given, strict=False)
        ]
    folder = options.out or beside(options.detections, "losses")
    page = write_page(folder, format_losses(options.name, options.difficulty, sets))
    if not options.quiet:
        for losses in sets:
            print(losses)
    console.print(f"what each kind of error takes: {page}", soft_wrap=True, highlight=False)
    write_json(options.json, as_json(options.name, options.difficulty, sets))


def _given(options: argparse.Namespace) -> list[tuple[Path, Path, Path | None]]:
    """Detections, labels and list of frames of each set."""
    from training.errors import EvaluationError

    first = (options.detections, options.labels, options.frames)
    if options.against is None:
        if options.against_labels or options.against_frames:
            raise EvaluationError("--against-labels and --against-frames go with --against; give those detections, too")
        return [first]
    frames = options.against_frames or (None if options.against_labels else options.frames)
    return [first, (options.against, options.against_labels or options.labels, frames)]


def _titles(given: list[tuple[Path, Path, Path | None]]) -> list[str]:
    """Names of the sets: those of the folders of detections, their whole paths where these are alike."""
    names = [detections.resolve().name for detections, _, _ in given]
    return names if len(set(names)) == len(names) else [str(detections) for detections, _, _ in given]
