"""`cosim doctor`: check which parts of cosim work on this machine, and show what to install for the others."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, write_json
from cosim.cli.progress import ProgressReport


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "doctor", help="check which parts of cosim work on this machine", description=__doc__
    )
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Check every part and print one line for each."""
    from cosim.doctor import can_record, examine
    from cosim.errors import CosimError

    findings = []
    with ProgressReport(console, "checking") as report:
        for finding in examine():
            findings.append(finding)
            report.say(f"checked {finding.name}")
            if not options.quiet:
                print(finding.line(), flush=True)
    write_json(options.json, {"can_record": can_record(findings), "parts": [asdict(finding) for finding in findings]})
    if not can_record(findings):
        missing = ", ".join(
            finding.name for finding in findings if not finding.works and (finding.needed or finding.name == "OSMesa")
        )
        raise CosimError(f"cosim run does not work here: {missing} is missing; install it as shown above")
