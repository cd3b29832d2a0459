"""`cosim train`: train a detector on simulated or real drives."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.options import add_common, write_json
from cosim.cli.progress import ProgressReport, training_progress

if TYPE_CHECKING:
    from training.evaluation import Evaluation


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "train", help="train a detector on drives", description=__doc__
    )
    parser.add_argument("config", type=Path, metavar="CONFIG.yaml", help="training configuration")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of checkpoints and logs (default: `out` of the configuration)"
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Train the detector, or resume an interrupted training."""
    from training.config import load_train_config
    from training.errors import TrainingError, demand_torch

    config = load_train_config(options.config)
    folder = options.out or config.out
    if folder is None:
        raise TrainingError(f"{options.config} names no folder for the results; add `out: DIR`, or give --out DIR")
    demand_torch()
    from training.run import Watcher, run_training

    with ProgressReport(console, "reading frames") as report:
        on_step = training_progress(report)

        def on_scores(name: str, evaluation: Evaluation) -> None:
            for kind, metrics in evaluation.results.items():
                values = ", ".join(
                    f"{metric} {metrics[metric][1].r40:.1f}" for metric in ("3d", "bev") if metric in metrics
                )
                console.print(f"{name}: {kind} moderate R40 {values}", highlight=False, soft_wrap=True)

        scores = run_training(config, folder, Watcher(report.advance, on_step, on_scores))
    console.print(f"{folder}: checkpoint.pt, log.jsonl, tensorboard/", soft_wrap=True, highlight=False)
    write_json(options.json, {"out": str(folder), "scores": scores})
