"""`cosim towns`: lists the built-in towns, or rebuilds their SUMO files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "towns", help="list or rebuild the built-in towns", description=__doc__
    )
    parser.add_argument("action", nargs="?", choices=("list", "build"), default="list", help="default: list")
    parser.add_argument("--town", metavar="T", help="only this one")
    parser.add_argument("--out", type=Path, metavar="DIR", help="build here instead of in place")
    add_common(parser)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """List or build."""
    from sumo_nets import RECIPES, TownError, build_town, built_in_folder

    if options.town is not None and options.town not in RECIPES:
        raise TownError(f"town {options.town!r} does not exist; choose one of {', '.join(RECIPES)}")
    for name, recipe in RECIPES.items():
        if options.town not in (None, name):
            continue
        if options.action == "build":
            folder = options.out / name if options.out else built_in_folder(name)
            build_town(recipe, folder)
            console.print(f"{name}: built in {folder}")
        else:
            console.print(f"{name}: {recipe.style}, seed {recipe.seed}")
