"""`cosim doctor`: what works on this machine, and what to install for the rest."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, write_json
from cosim.cli.progress import ProgressReport


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "doctor", help="what works on this machine, and what to install for the rest", description=__doc__
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Try every part and say a line of each."""
    from cosim.doctor import can_record, examine
    from cosim.errors import CosimError

    findings = []
    with ProgressReport(console, "trying") as report:
        for finding in examine():
            findings.append(finding)
            report.say(f"tried {finding.name}")
            if not options.quiet:
                print(finding.line(), flush=True)
    write_json(options.json, {"can_record": can_record(findings), "parts": [asdict(one) for one in findings]})
    if not can_record(findings):
        missing = ", ".join(one.name for one in findings if not one.works and (one.needed or one.name == "OSMesa"))
        raise CosimError(f"cosim run will not work here: {missing} is missing; install it as the lines above say")
