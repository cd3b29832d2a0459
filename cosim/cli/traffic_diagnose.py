"""`cosim traffic-diagnose`: identify the driver behaviour that a model is missing, from measured trajectories."""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, beside, without_nan, write_json
from cosim.cli.progress import ProgressReport
from cosim.cli.traffic_compare import add_input, at_least
from cosim.drives.writer import explained


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "traffic-diagnose", help="identify the driver behaviour that a model is missing", description=__doc__
    )
    add_input(parser)
    parser.add_argument(
        "--seeds",
        type=int,
        default=10,
        metavar="N",
        help="number of simulations, from which the random variation is estimated (default: 10)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the report page (default: MEASURED-diagnosis)"
    )
    parser.add_argument(
        "--config-out",
        type=Path,
        metavar="FILE",
        help="file of the improved configuration (default: config.yaml in the folder of the page)",
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Diagnose the driver model, then write the improved configuration and the page."""
    from cosim.driver_discrepancy import traffic_diagnose
    from cosim.driver_discrepancy.config_out import write_config
    from cosim.driver_discrepancy.page import format_diagnosis
    from cosim.driver_discrepancy.sentences import headline
    from cosim.report import write_page

    at_least("seeds", options.seeds, 4)
    at_least("workers", options.workers, 1)
    folder = options.out or beside(options.measured.with_suffix(""), "diagnosis")
    with ProgressReport(console, "reading the trajectories") as report:
        result = traffic_diagnose(
            options.measured,
            options.config,
            seeds=options.seeds,
            workers=options.workers,
            vtypes=options.vtypes,
            on_progress=report.say,
        )
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
    written = write_config(result.config, options.config_out or folder / "config.yaml")
    result = replace(result, config_out=os.path.relpath(written))
    page = write_page(folder, format_diagnosis(result, str(options.measured), str(options.config)))
    if not options.quiet:
        print(headline(result))
    improved = f"; the improved configuration: {result.config_out}" if result.effects else ""
    console.print(f"{page}{improved}", soft_wrap=True, highlight=False)
    write_json(options.json, without_nan(result.to_json()))
