"""`cosim traffic-compare`: measure the error of simulated traffic against measured trajectories."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, beside, without_nan, write_json
from cosim.cli.progress import ProgressReport
from cosim.drives.writer import explained


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "traffic-compare", help="measure the error of simulated traffic against trajectories", description=__doc__
    )
    add_input(parser)
    parser.add_argument(
        "--seeds", type=int, default=8, metavar="N", help="number of simulations with different seeds (default: 8)"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the report page (default: MEASURED-compare)")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def add_input(parser: argparse.ArgumentParser) -> None:
    """Add the input options of the traffic commands."""
    parser.add_argument(
        "measured",
        type=Path,
        metavar="MEASURED",
        help="file of measured trajectories: a table, FCD output, …; see docs/formats.md",
    )
    parser.add_argument(
        "--config",
        type=Path,
        required=True,
        metavar="FILE",
        help="run configuration of the traffic model, of which `town` and `behaviour` are used",
    )
    parser.add_argument(
        "--vtypes",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.rou.xml",
        help="SUMO file with further vehicle types; may be repeated",
    )
    parser.add_argument(
        "--workers", type=int, metavar="W", help="number of simulations run in parallel (default: one per core)"
    )


def at_least(name: str, value: int | None, least: int) -> None:
    """Check that an option has at least its minimum value.

    Raises:
        TrackError: the value is smaller.
    """
    from cosim.driver_discrepancy.tracks import TrackError

    if value is not None and value < least:
        raise TrackError(f"--{name} is {value}; give at least {least}")


def execute(options: argparse.Namespace, console: Console) -> None:
    """Simulate and compare, then write the page."""
    from cosim.driver_discrepancy import traffic_compare
    from cosim.driver_discrepancy.page import format_comparison
    from cosim.report import write_page

    at_least("seeds", options.seeds, 3)
    at_least("workers", options.workers, 1)
    folder = options.out or beside(options.measured.with_suffix(""), "compare")
    with ProgressReport(console, f"simulating with {options.seeds} seeds"):
        result = traffic_compare(
            options.measured, options.config, seeds=options.seeds, workers=options.workers, vtypes=options.vtypes
        )
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
    page = write_page(folder, format_comparison(result, str(options.measured), str(options.config)))
    if not options.quiet:
        print(result)
    console.print(f"{len(result.measured.ids)} vehicles on {page}", soft_wrap=True, highlight=False)
    write_json(options.json, without_nan(result.to_json()))
