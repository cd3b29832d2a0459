"""Runs one command of `cosim` as a user would: `python -P judge.py CODE whole|broken COMMAND …`.

CODE is the repository whose `cosim` runs; nothing of `tests.hidden` is in sight of it.
"""

import sys
from pathlib import Path


def main() -> int:
    """The command's exit code."""
    code, gate, *arguments = sys.argv[1:]
    import cosim
    from cosim.cli import main as command

    if Path(code) not in Path(str(cosim.__file__)).parents:
        raise SystemExit(f"cosim is {cosim.__file__}, not that of {code}; start with PYTHONPATH={code}")
    if gate == "broken":
        _break_gate()
    return command(arguments)


def _break_gate() -> None:
    """Let everything through: what a benchmark that can tell a bad gate from a good one must notice."""
    from dataclasses import replace

    from cosim.discrepancy import diagnose, select

    given = diagnose.__kwdefaults__ or {}
    given["settings"] = replace(given["settings"], level=float("inf"), most_findings=1)
    select.Candidate.worth = lambda self, beams: self.gain.value + 1e9


if __name__ == "__main__":
    sys.exit(main())
