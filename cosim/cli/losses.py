"""`cosim losses`: break down the lost average precision of a detector by error type and object property."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, beside, write_json
from cosim.cli.progress import ProgressReport
from cosim.cli.scoring_options import add_draws, add_scored, chosen_draws, demand_draws

_CLASSES = ("Car", "Pedestrian", "Cyclist")
_DIFFICULTIES = ("easy", "moderate", "hard")
_DRAWS = 300


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "losses",
        help="break down the lost average precision of a detector by error type",
        description=__doc__,
    )
    add_scored(parser)
    parser.add_argument(
        "--against",
        type=Path,
        metavar="DIR",
        help="folder of detections to compare with, of another detector or of other frames",
    )
    parser.add_argument(
        "--against-labels", type=Path, metavar="DIR", help="labels of --against (default: those of --labels)"
    )
    parser.add_argument(
        "--against-frames", type=Path, metavar="FILE", help="frames of --against (default: those of --frames)"
    )
    parser.add_argument("--class", dest="name", choices=_CLASSES, default="Car", help="object class (default: Car)")
    parser.add_argument(
        "--difficulty", choices=_DIFFICULTIES, default="moderate", help="KITTI difficulty (default: moderate)"
    )
    add_draws(parser, "", _DRAWS)
    parser.add_argument("--out", type=Path, metavar="PAGE_DIR", help="folder of the report page (default: DIR-losses)")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Read the detections, break down the losses, write the page."""
    from cosim.report import write_page
    from training.evaluation import read_results
    from training.evaluation.comparable import demand_comparable_classes, parse_classes, rename_classes
    from training.evaluation.losses import SETS_MENDED, as_json, drawn_frames, find_losses, format_losses
    from training.evaluation.slices import neighbouring_scans

    demand_draws(options)
    inputs = _input_sets(options)
    with ProgressReport(console, "reading") as report:
        names = parse_classes(options.classes)
        scored = [rename_classes(read_results(*paths), names) for paths in inputs]
        for results in scored:
            demand_comparable_classes(results, (options.name,))
        draws = chosen_draws(options, max(len(results.names) for results in scored), _DRAWS)
        times = drawn_frames(scored[0], scored[-1], draws, options.seed)
        report.begin("correcting errors", SETS_MENDED * len(inputs))
        sets = [
            find_losses(
                results,
                options.name,
                options.difficulty,
                title,
                drive=neighbouring_scans(labels),
                times=drawn,
                on_set=report.advance,
            )
            for title, results, drawn, (_, labels, _) in zip(_titles(inputs), scored, times, inputs, strict=False)
        ]
    folder = options.out or beside(options.detections, "losses")
    page = write_page(folder, format_losses(options.name, options.difficulty, sets))
    if not options.quiet:
        for losses in sets:
            print(losses)
    console.print(f"losses by error type: {page}", soft_wrap=True, highlight=False)
    write_json(options.json, as_json(options.name, options.difficulty, sets))


def _input_sets(options: argparse.Namespace) -> list[tuple[Path, Path, Path | None]]:
    """Paths of detections, labels and frame list of each set."""
    from training.errors import EvaluationError

    first = (options.detections, options.labels, options.frames)
    if options.against is None:
        if options.against_labels or options.against_frames:
            raise EvaluationError("--against-labels and --against-frames need --against; give those detections, too")
        return [first]
    frames = options.against_frames or (None if options.against_labels else options.frames)
    return [first, (options.against, options.against_labels or options.labels, frames)]


def _titles(inputs: list[tuple[Path, Path, Path | None]]) -> list[str]:
    """Titles of the sets: names of the detection folders, or their paths if the names are equal."""
    names = [detections.resolve().name for detections, _, _ in inputs]
    return names if len(set(names)) == len(names) else [str(detections) for detections, _, _ in inputs]
