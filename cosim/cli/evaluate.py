"""`cosim evaluate`: score detections against labels with the metrics of KITTI's object benchmark."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from cosim.cli.options import add_common, beside, write_json
from cosim.cli.progress import ProgressReport
from cosim.cli.scoring_options import add_draws, add_scored, chosen_draws, demand_draws

if TYPE_CHECKING:
    import numpy as np

    from training.evaluation import Evaluation, Scored
    from training.evaluation.slices import ScoreSlice

_DRAWS = 1000


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "evaluate", help="score detections with KITTI's metrics", description=__doc__
    )
    add_scored(parser)
    add_draws(parser, " of R40", _DRAWS)
    parser.add_argument(
        "--out", type=Path, metavar="PAGE_DIR", help="folder of the report page (default: DIR-evaluation)"
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Score the detections, print the average precisions, write the page."""
    from cosim.report.write import write_page
    from training.evaluation import evaluate, read_results
    from training.evaluation.as_json import as_json
    from training.evaluation.comparable import parse_classes, rename_classes
    from training.evaluation.page import format_page
    from training.evaluation.pictures import detection_pictures
    from training.evaluation.slices import neighbouring_scans

    demand_draws(options)
    with ProgressReport(console, "reading") as report:
        scored = read_results(options.detections, options.labels, options.frames)
        scored = rename_classes(scored, parse_classes(options.classes))
        report.begin(f"scoring {len(scored.names):,} frames")
        drive = neighbouring_scans(options.labels)
        evaluation = evaluate(scored, points=_label_points(scored, drive))
        intervals = _intervals(evaluation, options)
        parts = _parts(evaluation, drive)
    pictures = detection_pictures(scored, drive) if drive is not None else []
    title = f"{options.detections} against {options.labels}"
    page = write_page(
        options.out or beside(options.detections, "evaluation"),
        format_page(evaluation, title, intervals, parts, pictures),
    )
    if not options.quiet:
        _print_table(evaluation)
        _print_notes(evaluation, console)
    console.print(f"{len(scored.names):,} frames on {page}", soft_wrap=True, highlight=False)
    write_json(options.json, as_json(evaluation, intervals, parts))


def _label_points(scored: Scored, drive: Any) -> np.ndarray | None:
    """Points per label box; None if the labels have 2D boxes or there are no scans."""
    from training.evaluation.comparable import has_image_boxes
    from training.evaluation.rules import CLASSES
    from training.evaluation.slices import points_in_rows

    if drive is None or all(has_image_boxes(scored, name) for name in CLASSES):
        return None
    is_object = scored.labels.kind != "dontcare"
    return points_in_rows(scored.labels, is_object, scored.names, drive)


def _print_notes(evaluation: Evaluation, console: Console) -> None:
    from training.evaluation.comparable import unscored_classes
    from training.evaluation.rules import DIFFICULTIES, SAMPLES

    for name, note in evaluation.notes.items():
        console.print(f"{name}: {note}", soft_wrap=True, highlight=False)
    for name, metrics in evaluation.results.items():
        counts = [int(result.task.object_counts.sum()) for result in next(iter(metrics.values()))]
        if min(counts) < SAMPLES:
            listed = ", ".join(f"{count} {level}" for count, level in zip(counts, DIFFICULTIES, strict=True))
            console.print(
                f"{name}: labelled objects: {listed}; with n objects, fewer than {SAMPLES}, R40 cannot exceed "
                "(n - 1)/40, and without any it is 0; use the continuous AP of the page and the JSON",
                soft_wrap=True,
                highlight=False,
            )
    others = unscored_classes(evaluation.scored)
    if others:
        console.print(
            f"not scored: {', '.join(others)} (not KITTI classes; map them with --classes NAME=CLASS)",
            soft_wrap=True,
            highlight=False,
        )


def _intervals(evaluation: Evaluation, options: argparse.Namespace) -> dict[tuple[str, str], list[tuple[float, float]]]:
    import numpy as np

    from training.evaluation.bootstrap import interval, resample

    draws = chosen_draws(options, len(evaluation.scored.names), _DRAWS)
    if not draws:
        return {}
    return {
        (name, metric): [
            interval(resample(result, np.random.default_rng(options.seed), draws)[:, 0]) for result in levels
        ]
        for name, metrics in evaluation.results.items()
        for metric, levels in metrics.items()
    }


def _parts(evaluation: Evaluation, drive: Any) -> dict[str, dict[str, list[ScoreSlice]]]:
    from training.evaluation.slices import points_in_labels, slices

    parts = {}
    for name, metrics in evaluation.results.items():
        if "3d" in metrics:
            hard = metrics["3d"][2]
            parts[name] = slices(hard, None if drive is None else points_in_labels(hard, drive))
    return parts


def _print_table(evaluation: Evaluation) -> None:
    table = Table("class", "metric", "R40 easy", "moderate", "hard", "R11 easy", "moderate", "hard", box=None)
    for name, metrics in evaluation.results.items():
        for metric, levels in metrics.items():
            table.add_row(name, metric, *(r.text(kind) for kind in ("r40", "r11") for r in levels))
        if "2d" in metrics and evaluation.oriented:
            table.add_row(name, "aos", *(r.text(kind) for kind in ("aos40", "aos11") for r in metrics["2d"]))
    Console(width=100).print(table if evaluation.results else "no detection of Car, Pedestrian or Cyclist")
