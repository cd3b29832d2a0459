"""`cosim COMMAND …`: parse the command line, run the command, report user errors in one line with exit code 2."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from typing import NoReturn

from rich.console import Console

from cosim.cli import (
    add,
    calibrate,
    check,
    compare,
    detect,
    diagnose,
    doctor,
    effects,
    evaluate,
    experiment,
    export,
    losses,
    pattern,
    run,
    stats,
    towns,
    traffic_compare,
    traffic_diagnose,
    traffic_record,
    train,
    twin,
    variants,
    view,
)
from cosim.user_errors import user_errors

_COMMANDS = (
    run,
    check,
    variants,
    view,
    stats,
    towns,
    effects,
    twin,
    compare,
    diagnose,
    add,
    evaluate,
    losses,
    train,
    detect,
    experiment,
    export,
    pattern,
    calibrate,
    doctor,
)
_TRAFFIC = (traffic_compare, traffic_diagnose, traffic_record)


class _Parser(argparse.ArgumentParser):
    """Parser that reports errors in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def make_parser() -> argparse.ArgumentParser:
    """Create the parser of all commands; the command reference in the documentation is generated from it."""
    parser = _Parser(prog="cosim", description="Traffic co-simulation on SUMO with LiDAR, cameras and KITTI output.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    for module in (*_COMMANDS, *_TRAFFIC):
        module.add_command(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code: 0, or 2 for bad input."""
    options = make_parser().parse_args(arguments)
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s")
    console = Console(stderr=True, quiet=options.quiet)
    try:
        options.execute(options, console)
    except user_errors() as error:
        sys.stderr.write(f"cosim {options.command}: {error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write(f"cosim {options.command}: stopped; run the same command again to continue\n")
        return 130
    return 0
