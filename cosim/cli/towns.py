"""`cosim towns`: list the built-in towns, rebuild their SUMO files, or draw them on a page."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common
from cosim.cli.progress import ProgressReport


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "towns", help="list, rebuild or draw the built-in towns", description=__doc__
    )
    parser.add_argument(
        "action",
        nargs="?",
        choices=("list", "build", "show"),
        default="list",
        help="list the towns, build their SUMO files, or show them on a page (default: list)",
    )
    parser.add_argument("--town", metavar="T", help="name of a town (default: all towns)")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder to write to (default for build: the installed towns; for show: out/towns)",
    )
    add_common(parser)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """List, build or show towns."""
    from sumo_nets import RECIPES, TownError

    if options.town is not None and options.town not in RECIPES:
        raise TownError(f"town {options.town!r} does not exist; choose one of {', '.join(RECIPES)}")
    names = [name for name in RECIPES if options.town in (None, name)]
    {"list": _list, "build": _build, "show": _show}[options.action](names, options.out, console)


def _list(names: list[str], _: Path | None, console: Console) -> None:
    from sumo_nets import RECIPES

    for name in names:
        console.print(f"{name}: {RECIPES[name].style}, {RECIPES[name].layout.kind}, seed {RECIPES[name].seed}")


def _build(names: list[str], out: Path | None, console: Console) -> None:
    from sumo_nets import RECIPES, build_town, built_in_folder

    with ProgressReport(console, "building", len(names), unit="towns") as report:
        for name in names:
            folder = out / name if out else built_in_folder(name)
            build_town(RECIPES[name], folder)
            console.print(f"{name}: built in {folder}")
            report.advance()


def _show(names: list[str], out: Path | None, console: Console) -> None:
    from cosim.town_map import write_town_page
    from sumo_nets import read_town

    with ProgressReport(console, "drawing"):
        page = write_town_page([read_town(name) for name in names], out or Path("out/towns"))
    console.print(f"{len(names)} towns on {page}", soft_wrap=True)
