"""`cosim experiment`: train and test the rows of one of the paper's tables for which frames are available."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.options import add_common, write_json
from cosim.cli.progress import ProgressReport, training_progress

if TYPE_CHECKING:
    from training.loop import Moment


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "experiment", help="train and test the rows of one of the paper's tables", description=__doc__
    )
    parser.add_argument(
        "table",
        metavar="TABLE",
        help="built-in table (synthetic, synthetic_to_real, real_to_synthetic, few_shot, full) or a YAML file",
    )
    parser.add_argument("--variants", type=Path, metavar="DIR", help="folder of simulated drives from cosim variants")
    parser.add_argument("--real", type=Path, metavar="DIR", help="folder of real frames in KITTI's layout")
    parser.add_argument(
        "--few", default="fit", metavar="LIST", help="list in ImageSets/ of the few real training frames (default: fit)"
    )
    parser.add_argument(
        "--full",
        default="train",
        metavar="LIST",
        help="list in ImageSets/ of all real training frames (default: train)",
    )
    parser.add_argument(
        "--test", default="test", metavar="LIST", help="list in ImageSets/ of the real test frames (default: test)"
    )
    parser.add_argument(
        "--config", type=Path, metavar="FILE", help="training configuration: model, epochs, … (default: pillars_small)"
    )
    parser.add_argument(
        "--fine-tune",
        type=Path,
        metavar="FILE",
        help="changes of the configuration for fine-tuning (default: 20 epochs with a low learning rate)",
    )
    parser.add_argument("--only", metavar="NAMES", help="rows to run, separated by commas (default: all)")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the trainings and the tables")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Run the rows one after another, and write the table."""
    from training.errors import TrainingError, demand_torch
    from training.experiments import load_table

    table = load_table(options.table)
    chosen = list(table.rows)
    if options.only:
        chosen = [name.strip() for name in options.only.split(",")]
        unknown = [name for name in chosen if name not in table.rows]
        if unknown:
            raise TrainingError(f"--only names {unknown[0]!r}; rows of {options.table} are {', '.join(table.rows)}")
    demand_torch()
    from training.experiments.frames import Inputs, tuned_config
    from training.experiments.report import as_json, write_report
    from training.experiments.run import run_table
    from training.run import Watcher

    config = _config(options.config)
    tuned = tuned_config(config, _settings(options.fine_tune), str(options.fine_tune or "fine-tuning"))
    lists = (options.few, options.full, options.test)
    inputs = Inputs(options.variants, options.real, config, options.out, *lists, fine_tune=tuned)
    with ProgressReport(console, "reading frames") as report:
        started: list[str] = []

        def on_row(name: str) -> None:
            started.append(name)
            report.begin(f"row {len(started)} of {len(chosen)}, {name}: reading and scoring")

        def on_step(moment: Moment) -> None:
            training_progress(report, f"row {len(started)} of {len(chosen)}, {started[-1]}: ")(moment)

        rows = run_table(table, options.table, inputs, on_row, Watcher(on_step=on_step), only=chosen)
    folder = options.out / "tables" / Path(options.table).stem
    page = write_report(table, rows, folder)
    if not options.quiet:
        print((folder / "table.md").read_text(encoding="utf-8"))
    console.print(f"{page}", soft_wrap=True, highlight=False)
    write_json(options.json, as_json(table, rows))


def _config(path: Path | None) -> Any:
    """Read a training configuration without frames."""
    from training.config import parse_train_config

    return parse_train_config({"train": [], **_settings(path)}, str(path or "default"))


def _settings(path: Path | None) -> dict[str, Any]:
    from training.config import read_settings

    return read_settings(path) if path is not None else {}
